// What both pictures draw with: shapes that stand out against anything, and words.

export function outlined(context, points, fill, halo, width) {
  context.beginPath();
  points.forEach((point) => context.lineTo(...point));
  context.closePath();
  context.lineJoin = "round";
  context.lineWidth = width;
  context.strokeStyle = halo;
  context.stroke();
  context.fillStyle = fill;
  context.fill();
}

export function line(context, points, color, width) {
  context.lineWidth = width;
  context.strokeStyle = color;
  context.beginPath();
  points.forEach((point) => context.lineTo(...point));
  context.stroke();
}

export function words(context, text, [x, y], ink, halo) {
  context.font = "600 14px system-ui, sans-serif";
  context.lineWidth = 4;
  context.strokeStyle = halo;
  context.strokeText(text, x, y);
  context.fillStyle = ink;
  context.fillText(text, x, y);
}
