// Fingers, mouse and wheel on the map: what they do to a view with pan(), zoom(), toMap() and onTouch().

const STILL = 5;  // pixels that a touch may move

export function listen(canvas, view) {
  const fingers = new Map();
  let moved = 0, apart = 0;
  const at = (event) => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, at(event));
    moved = fingers.size > 1 ? Infinity : 0;
    apart = 0;
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const now = at(event);
    fingers.set(event.pointerId, now);
    moved += Math.hypot(now[0] - before[0], now[1] - before[1]);
    const [one, other] = fingers.values();
    if (other) {
      const distance = Math.hypot(one[0] - other[0], one[1] - other[1]);
      if (apart) view.zoom(distance / apart, [(one[0] + other[0]) / 2, (one[1] + other[1]) / 2]);
      apart = distance;
    }
    if (moved > STILL) view.pan((now[0] - before[0]) / fingers.size, (now[1] - before[1]) / fingers.size);
  });
  const lift = (event) => {
    if (fingers.delete(event.pointerId) && event.type === "pointerup" && moved <= STILL && view.onTouch) view.onTouch(view.toMap(at(event)));
    apart = 0;
  };
  canvas.addEventListener("pointerup", lift);
  canvas.addEventListener("pointercancel", lift);
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    view.zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), at(event));
  }, { passive: false });
}
