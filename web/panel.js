// Words beside the map: position, checks, stages, marks. All text from outside is set as text, never as HTML.

const STALE = 8;  // s without a report of a stage
const LEVELS = ["good", "warn", "bad", "bad"];
const ANSWERS = { fine: "good", DOUBTFUL: "bad", "not measured": "idle" };
const $ = (id) => document.getElementById(id);

function element(tag, classes, ...content) {
  const made = document.createElement(tag);
  made.className = classes;
  made.append(...content);
  return made;
}

function fill(list, items, empty) {
  const text = JSON.stringify([items, empty]);
  if (list.dataset.shown === text) return false;
  list.dataset.shown = text;
  list.replaceChildren();
  if (!items.length && empty) list.append(element("li", "idle", empty));
  return true;
}

export function minutes(seconds) {
  const whole = Math.max(Math.round(seconds), 0);
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}

function ago(seconds) {
  return seconds === null || seconds === undefined ? "–" : `${Math.round(seconds)} s ago`;
}

export function showPosition(model, connection) {
  const pill = $("position"), { now } = model, cut = connection.isCut || !now;
  const status = now && now.status;
  pill.dataset.state = cut || !status ? 3 : status.state;
  const words = cut ? (connection.refused || `no connection since ${Math.round(connection.silence)} s`) : status ? status.text : "no position yet";
  pill.lastElementChild.textContent = words;
  pill.title = words;
  document.body.classList.toggle("cut", Boolean(cut));
  const notice = cut ? (connection.isCut ? words : "") : now.waiting;
  $("notice").hidden = !notice;
  $("notice").textContent = notice;
  const place = now && now.pose;
  $("depth").textContent = place ? `${place[3].toFixed(1)} m` : "–";
  $("heading").textContent = place ? `${String(Math.round(place[4]) % 360).padStart(3, "0")}°` : "–";
  $("age").textContent = ago(status && status.age);
}

export function showChecks(model) {
  const checks = [...model.stages.values()].flatMap((stage) => stage.checks);
  const causes = [...model.stages.values()].map((stage) => stage.cause).filter(Boolean);
  $("cause").hidden = !causes.length;
  $("cause").textContent = causes.length ? `Doubted: ${causes.join("; ")}` : "";
  const list = document.querySelector("#checks ul"), order = ["DOUBTFUL", "not measured", "fine"];
  checks.sort((one, other) => order.indexOf(one[1]) - order.indexOf(other[1]));
  if (!fill(list, checks, "no scan matched yet")) return;
  for (const [name, answer, reason] of checks) {
    list.append(element("li", ANSWERS[answer], element("b", "", name), element("em", "", answer.toLowerCase()), element("span", "", reason)));
  }
}

export function showStages(model) {
  const ages = (model.now && model.now.ages) || {}, time = performance.now();
  const inputs = [["beams", ages.beams], ["fix", ages.fix], ["map", ages.map]].filter(([, age]) => age !== undefined);
  const stages = [...model.stages.values()].map((stage) => {
    const isStale = (time - stage.heard) / 1000 > STALE, [node, name = node] = stage.name.replace(/^\//, "").split(": ");
    const counts = stage.counts.filter(([what]) => !what.includes("points") && !what.includes("moments")).slice(0, 3);
    const words = counts.map(([what, total, rate]) => `${what} ${total}${Number(rate) ? ` (${Number(rate).toFixed(1)}/s)` : ""}`).join(" · ");
    return [name, isStale ? "idle" : LEVELS[stage.level] || "bad", isStale ? "silent" : stage.text, words];
  });
  const list = document.querySelector("#stages ul");
  if (!fill(list, [inputs.map(([name, age]) => [name, Math.round(age)]), stages], "")) return;
  if (inputs.length) list.append(element("li", "inputs", ...inputs.map(([name, age]) => element("span", "", `${name} ${ago(age)}`))));
  for (const [name, level, text, words] of stages) {
    list.append(element("li", level, element("b", "", name), element("em", "", text), element("span", "", words)));
  }
}

export function showMarks(model, onDelete, onLook) {
  $("chartfile").hidden = !model.marks.length;
  const list = document.querySelector("#marks ul");
  if (!fill(list, model.marks, "none; Mark, then touch the map")) return;
  for (const [name, x, y] of model.marks) {
    const look = element("button", "link", name), gone = element("button", "delete", "×");
    look.onclick = () => onLook([x, y]);
    gone.setAttribute("aria-label", `delete ${name}`);
    gone.onclick = () => onDelete(name);
    list.append(element("li", "mark", look, element("span", "", `${x.toFixed(1)}, ${y.toFixed(1)} m`), gone));
  }
}
