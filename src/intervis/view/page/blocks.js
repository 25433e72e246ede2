// Blocks of columns, as intervis/view/columns.py writes them.

/** Bytes of base64 text. */
export function bytesOf(base64) {
  const text = atob(base64.trim());
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes;
}

/** The columns of a block by name, as Int32Array. */
export async function columnsOf(bytes) {
  const inflated = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const content = new Uint8Array(await new Response(inflated).arrayBuffer());
  const headLength = new DataView(content.buffer).getUint32(0, true);
  const directory = JSON.parse(new TextDecoder().decode(content.subarray(4, 4 + headLength)));
  const columns = {};
  let at = 4 + headLength;
  for (const [name, count, planes, byDifference, signed] of directory) {
    columns[name] = column(content.subarray(at, at + planes * count), count, byDifference, signed);
    at += planes * count;
  }
  return columns;
}

function column(octets, count, byDifference, signed) {
  const values = new Int32Array(count);
  const planes = count ? octets.length / count : 0;
  let last = 0;
  for (let i = 0; i < count; i++) {
    let value = 0;
    for (let plane = 0; plane < planes; plane++) value |= octets[plane * count + i] << (8 * plane);
    if (signed) value = (value >>> 1) ^ -(value & 1);
    last = byDifference ? (last + value) | 0 : value;
    values[i] = last;
  }
  return values;
}
