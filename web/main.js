// Puts the page together: messages to the views, buttons to requests, one loop that draws what changed.

import { Connection } from "./connection.js";
import { MapView } from "./map_view.js";
import { Model } from "./model.js";
import { minutes, showChecks, showMarks, showPosition, showStages } from "./panel.js";
import { SonarView } from "./sonar_view.js";
import { palette } from "./theme.js";

const $ = (id) => document.getElementById(id);
const asked = new URLSearchParams(location.search);
const model = new Model();
const sonar = new SonarView($("disc"), model);
const map = new MapView($("chart"), model, sonar);
const connection = new Connection(take, () => ({ run: model.run, revision: model.revision }));
let marked = null, shownVersion = -1;

function take(kind, content) {
  if (kind === "hello" && content.run !== model.run) sonar.clear();
  if (kind === "beam") sonar.take(content);
  else if (kind === "refused") say(content);
  else model.take(kind, content);
}

function say(words) {
  $("notice").hidden = false;
  $("notice").textContent = words;
  say.until = performance.now() + 4000;
}

function remember(key, value) {
  try { localStorage.setItem(key, value); } catch { /* frames may not store */ }
}

function remembered(key) {
  try { return localStorage.getItem(key); } catch { return null; }
}

function useTheme(theme) {
  document.documentElement.dataset.theme = theme;
  map.use(palette(theme));
  sonar.use(palette(theme));
}

function press(id, isPressed) { $(id).setAttribute("aria-pressed", isPressed); }

function startMarking(isOn) {
  press("marking", isOn);
  document.body.classList.toggle("marking", isOn);
  $("naming").hidden = true;
}

function showTime() {
  const slider = $("time"), end = model.now ? model.now.t : 0;
  slider.max = Math.ceil(end);
  if (map.time === null) slider.value = slider.max;
  $("clock").textContent = map.time === null ? minutes(end) : `${minutes(map.time)} / ${minutes(end)}`;
  press("live", map.time === null);
  document.body.classList.toggle("past", map.time !== null);
}

function setTime(time) {
  map.time = time;
  map.isDirty = true;
  showTime();
}

const dark = window.matchMedia("(prefers-color-scheme: dark)");
const wished = () => asked.get("theme") || remembered("theme") || (dark.matches ? "dark" : "light");
useTheme(wished());
dark.addEventListener("change", () => useTheme(wished()));
if (asked.get("widget")) document.body.dataset.widget = asked.get("widget") === "sonar" ? "sonar" : "map";

$("theme").onclick = () => {
  const other = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
  remember("theme", other);
  useTheme(other);
};
map.onFollow = (follow) => press("follow", follow);
$("follow").onclick = () => map.setFollow(!map.follow);
$("whole").onclick = () => { map.touched = true; map.whole(); };
$("nearer").onclick = () => map.zoom(1.4);
$("farther").onclick = () => map.zoom(1 / 1.4);
$("overlay").onclick = () => { map.overlay = !map.overlay; map.isDirty = true; press("overlay", map.overlay); };
$("up").onclick = () => { sonar.bowUp = !sonar.bowUp; sonar.repaint(); $("up").textContent = sonar.bowUp ? "bow up" : "north up"; };
$("marking").onclick = () => startMarking($("marking").getAttribute("aria-pressed") !== "true");
$("cancel").onclick = () => startMarking(false);
$("time").oninput = () => setTime(Number($("time").value) >= Number($("time").max) ? null : Number($("time").value));
$("live").onclick = () => setTime(null);
map.onTouch = (place) => {
  if (!document.body.classList.contains("marking")) return;
  marked = place;
  $("naming").hidden = false;
  $("name").value = "";
  $("name").focus();
};
$("naming").onsubmit = (event) => {
  event.preventDefault();
  const name = $("name").value.trim();
  if (name) connection.send({ mark: { name, x: marked[0], y: marked[1] } });
  startMarking(false);
};
addEventListener("keydown", (event) => {
  if (event.target.tagName === "INPUT") return;
  const keys = { f: "follow", a: "whole", "+": "nearer", "=": "nearer", "-": "farther", m: "marking" };
  if (keys[event.key]) $(keys[event.key]).click();
  if (event.key === "Escape") startMarking(false);
});

function words() {
  if (!(say.until > performance.now())) showPosition(model, connection);
  showChecks(model);
  showStages(model);
  showMarks(model, (name) => connection.send({ delete: { name } }), (place) => { map.setFollow(false); map.centre = place; map.isDirty = true; });
  showTime();
  $("reach").textContent = sonar.reach ? `${sonar.reach.toFixed(0)} m` : "";
}

function frame() {
  const isNew = shownVersion !== model.version;
  shownVersion = model.version;
  if (sonar.isDirty) map.isDirty ||= map.overlay;
  if (isNew || map.isDirty || model.isGliding) map.draw();
  if (sonar.isDirty || isNew) sonar.draw();
  requestAnimationFrame(frame);
}

setInterval(words, 250);
requestAnimationFrame(frame);
// What tests and curious people look at.
window.page = { model, map, sonar, connection };
