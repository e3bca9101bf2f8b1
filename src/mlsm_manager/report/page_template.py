"""The page without its content; "$" names what page.py fills in."""

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,">
<title>$title</title>
<style>
body { font-family: system-ui, sans-serif; margin: 0.8em auto; max-width: 1360px; padding: 0 1em; color: #222; }
h1 { font-size: 1.5em; margin: 0.3em 0; overflow-wrap: anywhere; }
h2 { font-size: 1.15em; margin-top: 2em; border-bottom: 1px solid #ddd; }
table { border-collapse: collapse; margin: 0.5em 0; } th { text-align: left; }
td, th { padding: 0.15em 1em 0.15em 0; vertical-align: top; }
td { font-variant-numeric: tabular-nums; }
.lamp { display: inline-block; width: 0.9em; height: 0.9em; border-radius: 50%; vertical-align: -0.1em; }
.summary { font-size: 1.2em; margin: 0.3em 0; }
.head { display: grid; grid-template-columns: minmax(0, 1fr) 21em; gap: 1.5em; }
.above { height: min(74vh, 700px); } .above > div { height: 100%; }
#time { width: 100%; }
#above image { image-rendering: pixelated; }
.printed { display: none; max-width: 100%; }
@media (max-width: 800px) {
  .head { display: block; } .above { height: 105vw; }
  .checks thead { display: none; } .checks td { display: inline; padding: 0 0.4em 0 0; }
  .checks td:nth-child(2) { font-weight: 600; } .checks td:nth-child(3) { display: block; margin: 0 0 0.9em 1.3em; }
  .checks td:nth-child(4) { display: none; }
}
@media print {
  .head { display: block; } .above { height: auto; } .turning, .slider, .modebar-container { display: none; }
  .printed { display: block; } h2 { break-after: avoid; } tr, .plotly-graph-div { break-inside: avoid; }
}
</style>
<script>$plotly</script>
</head>
<body>
<h1>$title</h1>
<p class="summary">$summary</p>
<div class="head">
<div>
<div class="above">$above</div>
<div class="slider">
<label for="time">Scan:</label> <output id="told"></output>
<input id="time" type="range" min="0" max="$last_scan" value="0" step="1">
</div>
</div>
<div>$facts $errors</div>
</div>
$solid
<h2>Odometry and correction</h2>
$correction
<h2>Can this run be trusted?</h2>
$checks
<h2>What was found out about sonar and odometry</h2>
$calibration
<h2>What was refused</h2>
$rejected
<h2>Health of the sonar</h2>
$health
<h2>Parameters</h2>
<details><summary>all parameters of this run</summary>$parameters</details>
<script type="application/json" id="scans">$scans</script>
<script>
(function () {
  var data = JSON.parse(document.getElementById("scans").textContent);
  var plot = document.getElementById("above"), slider = document.getElementById("time");
  var told = document.getElementById("told");
  function traceNamed(name) { return plot.data.findIndex(function (trace) { return trace.name === name; }); }
  function numbers(text) {
    var binary = atob(text), bytes = new Uint8Array(binary.length);
    for (var i = 0; i < binary.length; i++) bytes[i] = binary.charCodeAt(i);
    var view = new DataView(bytes.buffer), result = [];
    for (var k = 0; k < bytes.length; k += 2) result.push(view.getInt16(k, true));
    return result;
  }
  function show() {
    var scan = data.scans[Number(slider.value)], values = numbers(scan.points), x = [], y = [];
    for (var i = 0; i < values.length; i += 2) {
      x.push(scan.vehicle[0] + data.unit * values[i]);
      y.push(scan.vehicle[1] + data.unit * values[i + 1]);
    }
    told.textContent = (Number(slider.value) + 1) + " of " + data.scans.length + ", " + scan.time + " s, " +
      scan.echoes + " echoes" + (scan.rejection ? ", refused: " + scan.rejection : "");
    Plotly.restyle(plot, {x: [x, [scan.vehicle[0]]], y: [y, [scan.vehicle[1]]]},
      [traceNamed("$scan_trace"), traceNamed("$vehicle_trace")]);
  }
  // Browsers print no WebGL: a picture of the 3-D view stands in its place.
  function picture() {
    var solid = document.getElementById("solid"), printed = document.querySelector(".printed");
    if (!solid) return;
    var farther = Math.max(1, 1.1 * solid.clientHeight / solid.clientWidth), eye = solid.layout.scene.camera.eye;
    Plotly.relayout(solid, {"scene.camera.eye": {x: farther * eye.x, y: farther * eye.y, z: farther * eye.z}}).then(
      function () { return Plotly.toImage(solid, {format: "png", width: 1000, height: 600}); }).then(
      function (url) { printed.src = url; });
  }
  // Figures do not shrink to the paper by themselves.
  function sized(change) {
    document.querySelectorAll(".plotly-graph-div").forEach(function (one) { Plotly.relayout(one, change); });
  }
  window.addEventListener("beforeprint", function () { sized({autosize: false, width: 690}); });
  window.addEventListener("afterprint", function () { sized({autosize: true, width: null}); });
  slider.addEventListener("input", show);
  window.addEventListener("load", show);
  window.addEventListener("load", picture);
})();
</script>
</body>
</html>
"""

SOLID = """<h2>Map in 3-D</h2>
<div class="turning">$figure</div>
<img class="printed" alt="The map in 3-D">
"""
