// What lies on and around the walls: grid, trail, fixes, vehicle, ellipse, marks, scale bar, north.

import { wrapped } from "./model.js";
import { line, outlined, words } from "./pen.js";

const WITHIN = Math.sqrt(-2 * Math.log(0.05));  // deviations of an ellipse that holds 95 %
const BARS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000];

export function drawGrid(view) {
  const { context, colors, width, height } = view, step = BARS.find((bar) => bar * view.scale >= 60) || 5000;
  const corners = [[0, 0], [width, 0], [0, height], [width, height]].map((point) => view.toMap(point));
  for (const axis of [0, 1]) {
    const own = corners.map((point) => point[axis]), other = corners.map((point) => point[1 - axis]);
    const ends = [Math.min(...other), Math.max(...other)];
    for (let value = Math.ceil(Math.min(...own) / step) * step; value <= Math.max(...own); value += step) {
      line(context, ends.map((end) => view.toScreen(axis ? [end, value] : [value, end])), colors.grid, 1);
    }
  }
}

export function drawTrack(view, place) {
  const { context, model, colors, time } = view;
  const points = model.upTo(model.track, time).map((row) => view.toScreen([row[1], row[2]]));
  if (place) points.push(view.toScreen(place));
  context.lineJoin = context.lineCap = "round";
  line(context, points, colors.ground, 5);
  line(context, points, colors.trail, 2.5);
  context.fillStyle = colors.ground;
  context.lineWidth = 1.5;
  for (const fix of model.upTo(model.fixes, time)) {
    context.beginPath();
    context.arc(...view.toScreen([fix[1], fix[2]]), 3, 0, 2 * Math.PI);
    context.fill();
    context.stroke();
  }
}

export function drawVehicle(view, place) {
  const { context, model: { now }, colors, time } = view, [x, y] = view.toScreen(place);
  const covariance = time === null && now && now.covariance;
  if (covariance && covariance.every((one) => one !== null)) drawEllipse(view, [x, y], covariance, colors.states[now.status ? now.status.state : 3]);
  context.save();
  context.translate(x, y);
  context.rotate(Math.PI / 2 - wrapped(place[2] + view.turn));
  outlined(context, [[0, -20], [10, 13], [0, 8], [-10, 13]], time === null ? colors.vehicle : colors.muted, colors.halo, 5);
  context.restore();
}

function drawEllipse(view, [x, y], [xx, xy, yy], color) {
  const { context } = view, mean = (xx + yy) / 2, apart = Math.hypot((xx - yy) / 2, xy);
  const [long, short] = [mean + apart, Math.max(mean - apart, 0)].map((value) => WITHIN * Math.sqrt(value) * view.scale);
  const direction = Math.atan2(2 * xy, xx - yy) / 2 + view.turn;
  context.beginPath();
  context.ellipse(x, y, Math.max(long, 1), Math.max(short, 1), -direction, 0, 2 * Math.PI);
  context.globalAlpha = 0.18;
  context.fillStyle = color;
  context.fill();
  context.globalAlpha = 1;
  context.lineWidth = 2.5;
  context.strokeStyle = color;
  context.stroke();
}

export function drawMarks(view) {
  const { context, colors } = view;
  context.textBaseline = "middle";
  for (const [name, mx, my] of view.model.marks) {
    const [x, y] = view.toScreen([mx, my]);
    outlined(context, [[x, y], [x - 7, y - 15], [x, y - 22], [x + 7, y - 15]], colors.mark, colors.halo, 3);
    words(context, name, [x + 12, y - 13], colors.ink, colors.halo);
  }
}

export function drawScale(view) {
  const { context, colors } = view, length = BARS.filter((bar) => bar * view.scale <= Math.min(140, view.width / 3)).pop() || BARS[0];
  const x = 18, y = view.height - 20, end = x + length * view.scale, bar = [[x, y - 7], [x, y], [end, y], [end, y - 7]];
  context.lineCap = "butt";
  line(context, bar, colors.ground, 6);
  line(context, bar, colors.ink, 2.5);
  context.textBaseline = "bottom";
  words(context, `${length} m`, [x + 6, y - 4], colors.ink, colors.ground);
}

export function drawNorth({ context, colors }, x = 34, y = 44) {
  context.beginPath();
  context.arc(x, y, 20, 0, 2 * Math.PI);
  context.fillStyle = colors.card;
  context.fill();
  outlined(context, [[x, y - 16], [x + 6, y + 2], [x, y - 2], [x - 6, y + 2]], colors.states[3], colors.card, 1);
  context.fillStyle = colors.ink;
  context.textAlign = "center";
  context.textBaseline = "alphabetic";
  context.font = "700 13px system-ui, sans-serif";
  context.fillText("N", x, y + 14);
  context.textAlign = "left";
}
