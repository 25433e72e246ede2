// Mouse, touch and pen on a canvas: click, drag, pan, zoom.

const CLICK_PX = 5;

/**
 * Calls onDrag(du, dv, isPan), onZoom(factor, u, v) with shares of the canvas from -1 to 1, and
 * onClick(x, y) with CSS pixels. onGrab(x, y) may take over a drag: it returns a function of (x, y).
 */
export function followPointer(canvas, { onDrag, onZoom, onClick, onGrab = () => null }) {
  const held = new Map();
  let moved = 0;
  let grabbed = null;
  const place = (event) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  const shares = ([x, y]) => [(2 * x) / canvas.clientWidth - 1, 1 - (2 * y) / canvas.clientHeight];

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    held.set(event.pointerId, place(event));
    if (held.size === 1) {
      moved = 0;
      grabbed = onGrab(...place(event));
    }
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = held.get(event.pointerId);
    if (!before) return;
    const now = place(event);
    moved += Math.hypot(now[0] - before[0], now[1] - before[1]);
    if (held.size === 2) {
      pinch(held, event.pointerId, now);
    } else if (grabbed) {
      grabbed(...now);
    } else if (moved > CLICK_PX) {
      const [u0, v0] = shares(before);
      const [u1, v1] = shares(now);
      onDrag(u1 - u0, v1 - v0, event.shiftKey || (event.buttons & 6) !== 0);
    }
    held.set(event.pointerId, now);
  });
  const pinch = (pointers, id, now) => {
    const [, other] = [...pointers].find(([key]) => key !== id);
    const before = pointers.get(id);
    const spread = (a) => Math.max(Math.hypot(a[0] - other[0], a[1] - other[1]), 1);
    const middle = (a) => shares([(a[0] + other[0]) / 2, (a[1] + other[1]) / 2]);
    onZoom(spread(before) / spread(now), ...middle(now));
    const [[u0, v0], [u1, v1]] = [middle(before), middle(now)];
    onDrag(u1 - u0, v1 - v0, true);
  };
  const release = (event) => {
    if (!held.delete(event.pointerId)) return;
    if (event.type === "pointerup" && moved <= CLICK_PX && !held.size) onClick(...place(event));
    grabbed = null;
  };
  canvas.addEventListener("pointerup", release);
  canvas.addEventListener("pointercancel", release);
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      onZoom(Math.exp(Math.min(Math.max(event.deltaY, -200), 200) * 0.0015), ...shares(place(event)));
    },
    { passive: false },
  );
}
