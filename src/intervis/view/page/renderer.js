// WebGL2: points, thick segments and triangles, each with a colour of its own.

const POINT_VERTEX = `#version 300 es
uniform mat4 u_matrix;
uniform float u_size, u_least, u_most;
in vec3 a_position;
in vec4 a_colour;
out vec4 v_colour;
void main() {
  gl_Position = a_colour.a == 0.0 ? vec4(2.0, 2.0, 2.0, 1.0) : u_matrix * vec4(a_position, 1.0);
  gl_PointSize = clamp(u_size / gl_Position.w, u_least, u_most);
  v_colour = a_colour;
}`;

const POINT_FRAGMENT = `#version 300 es
precision mediump float;
in vec4 v_colour;
out vec4 colour;
void main() {
  vec2 from_middle = gl_PointCoord - 0.5;
  if (dot(from_middle, from_middle) > 0.25) discard;
  colour = vec4(v_colour.rgb, 1.0);
}`;

const SEGMENT_VERTEX = `#version 300 es
uniform mat4 u_matrix;
uniform vec2 u_pixels;
in vec2 a_corner;
in vec3 a_from, a_to;
in vec4 a_colour;
in float a_width;
out vec4 v_colour;
const float NEAR = 0.05;
void main() {
  vec4 a = u_matrix * vec4(a_from, 1.0), b = u_matrix * vec4(a_to, 1.0);
  if (a.w < NEAR && b.w < NEAR) { gl_Position = vec4(2.0, 2.0, 2.0, 1.0); return; }
  if (a.w < NEAR) a = mix(a, b, (NEAR - a.w) / (b.w - a.w));
  if (b.w < NEAR) b = mix(b, a, (NEAR - b.w) / (a.w - b.w));
  vec2 along = (b.xy / b.w - a.xy / a.w) * u_pixels;
  vec2 across = length(along) > 0.0 ? normalize(vec2(-along.y, along.x)) : vec2(0.0, 1.0);
  vec4 end = a_corner.x < 0.5 ? a : b;
  end.xy += across * a_corner.y * a_width / u_pixels * end.w;
  gl_Position = end;
  v_colour = a_colour;
}`;

const FLAT_VERTEX = `#version 300 es
uniform mat4 u_matrix;
in vec3 a_position;
in vec4 a_colour;
out vec4 v_colour;
void main() {
  gl_Position = u_matrix * vec4(a_position, 1.0);
  v_colour = a_colour;
}`;

const FLAT_FRAGMENT = `#version 300 es
precision mediump float;
in vec4 v_colour;
out vec4 colour;
void main() { colour = v_colour; }`;

const FLOATS_PER_SEGMENT = 11;

/** A colour "#rrggbb" as numbers from 0 to 255, with an opacity. */
export function rgba(hex, opacity = 1) {
  const value = parseInt(hex.slice(1), 16);
  return [value >> 16, (value >> 8) & 255, value & 255, Math.round(255 * opacity)];
}

export class Renderer {
  /** Throws an Error where the browser has no WebGL2. */
  constructor(canvas) {
    this.gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
    if (!this.gl) throw new Error("no WebGL2");
    this.canvas = canvas;
    this.points = program(this.gl, POINT_VERTEX, POINT_FRAGMENT);
    this.segments = program(this.gl, SEGMENT_VERTEX, FLAT_FRAGMENT);
    this.flat = program(this.gl, FLAT_VERTEX, FLAT_FRAGMENT);
    this.corners = buffer(this.gl, new Float32Array([0, -1, 1, -1, 0, 1, 1, 1]));
  }

  begin(background) {
    const { gl } = this;
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.clearColor(...background.map((value) => value / 255));
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.enable(gl.BLEND);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  }

  /** Buffers of points: positions (N, 3) floats and colours (N, 4) bytes. */
  pointBuffers(positions, colours) {
    return {
      positions: buffer(this.gl, positions),
      colours: buffer(this.gl, colours),
      count: positions.length / 3,
    };
  }

  drawPoints(buffers, matrix, size) {
    const { gl } = this;
    gl.useProgram(this.points.handle);
    gl.uniformMatrix4fv(this.points.uniform.u_matrix, false, matrix);
    gl.uniform1f(this.points.uniform.u_size, size.scale);
    gl.uniform1f(this.points.uniform.u_least, size.least);
    gl.uniform1f(this.points.uniform.u_most, size.most);
    attribute(gl, this.points, "a_position", buffers.positions, 3);
    attribute(gl, this.points, "a_colour", buffers.colours, 4, gl.UNSIGNED_BYTE);
    gl.drawArrays(gl.POINTS, 0, buffers.count);
    detach(gl, this.points);
  }

  /** Buffers of segments: a list of { from, to, colour: rgba, width: px }. */
  segmentBuffers(segments) {
    const values = new Float32Array(FLOATS_PER_SEGMENT * segments.length);
    segments.forEach(({ from, to, colour, width }, i) => {
      const numbers = [...from, ...to, ...colour.map((value) => value / 255), width];
      values.set(numbers, FLOATS_PER_SEGMENT * i);
    });
    return { values: buffer(this.gl, values), count: segments.length };
  }

  drawSegments(buffers, matrix, ratio, isCovered = true) {
    if (!buffers.count) return;
    const { gl } = this;
    if (!isCovered) gl.disable(gl.DEPTH_TEST);
    gl.useProgram(this.segments.handle);
    gl.uniformMatrix4fv(this.segments.uniform.u_matrix, false, matrix);
    gl.uniform2f(this.segments.uniform.u_pixels, this.canvas.width / ratio, this.canvas.height / ratio);
    attribute(gl, this.segments, "a_corner", this.corners, 2);
    const stride = 4 * FLOATS_PER_SEGMENT;
    const parts = [["a_from", 3, 0], ["a_to", 3, 12], ["a_colour", 4, 24], ["a_width", 1, 40]];
    for (const [name, size, offset] of parts) {
      attribute(gl, this.segments, name, buffers.values, size, gl.FLOAT, stride, offset, 1);
    }
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, buffers.count);
    detach(gl, this.segments);
    gl.enable(gl.DEPTH_TEST);
  }

  drawTriangles(buffers, matrix) {
    if (!buffers.count) return;
    const { gl } = this;
    gl.useProgram(this.flat.handle);
    gl.uniformMatrix4fv(this.flat.uniform.u_matrix, false, matrix);
    attribute(gl, this.flat, "a_position", buffers.positions, 3);
    attribute(gl, this.flat, "a_colour", buffers.colours, 4, gl.UNSIGNED_BYTE);
    gl.depthMask(false);
    gl.drawArrays(gl.TRIANGLES, 0, buffers.count);
    gl.depthMask(true);
    detach(gl, this.flat);
  }

  release(buffers) {
    for (const name of ["positions", "colours", "values"]) {
      if (buffers?.[name]) this.gl.deleteBuffer(buffers[name]);
    }
  }
}

function buffer(gl, values) {
  const handle = gl.createBuffer();
  gl.bindBuffer(gl.ARRAY_BUFFER, handle);
  gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
  return handle;
}

function attribute(gl, of, name, values, size, type = gl.FLOAT, stride = 0, offset = 0, divisor = 0) {
  const place = of.attribute[name];
  gl.bindBuffer(gl.ARRAY_BUFFER, values);
  gl.enableVertexAttribArray(place);
  gl.vertexAttribPointer(place, size, type, type === gl.UNSIGNED_BYTE, stride, offset);
  gl.vertexAttribDivisor(place, divisor);
}

/** Attributes stay enabled for all programs: those of this one would refer to deleted buffers. */
function detach(gl, of) {
  for (const place of Object.values(of.attribute)) {
    gl.vertexAttribDivisor(place, 0);
    gl.disableVertexAttribArray(place);
  }
}

function program(gl, vertex, fragment) {
  const handle = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(handle, shader);
  }
  gl.linkProgram(handle);
  if (!gl.getProgramParameter(handle, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(handle));
  const found = { handle, attribute: {}, uniform: {} };
  for (let i = 0; i < gl.getProgramParameter(handle, gl.ACTIVE_ATTRIBUTES); i++) {
    const { name } = gl.getActiveAttrib(handle, i);
    found.attribute[name] = gl.getAttribLocation(handle, name);
  }
  for (let i = 0; i < gl.getProgramParameter(handle, gl.ACTIVE_UNIFORMS); i++) {
    const { name } = gl.getActiveUniform(handle, i);
    found.uniform[name] = gl.getUniformLocation(handle, name);
  }
  return found;
}
