"""The page without its content; "$" names what page.py fills in."""

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,">
<title>$title</title>
<style>
body { font-family: system-ui, sans-serif; margin: 1.5em auto; max-width: 1200px; padding: 0 1em; color: #222; }
h1 { font-size: 1.5em; } h2 { font-size: 1.15em; margin-top: 2em; border-bottom: 1px solid #ddd; }
table { border-collapse: collapse; margin: 0.5em 0; } th { text-align: left; }
td, th { padding: 0.15em 1em 0.15em 0; vertical-align: top; }
td { font-variant-numeric: tabular-nums; }
.lamp { display: inline-block; width: 0.9em; height: 0.9em; border-radius: 50%; vertical-align: -0.1em; }
.summary { font-size: 1.2em; }
#time { width: 100%; }
#above image { image-rendering: pixelated; }
</style>
<script>$plotly</script>
</head>
<body>
<h1>$title</h1>
<p class="summary">$summary</p>
$facts
$errors
<h2>Map and path from above</h2>
<p><label for="time">Scan:</label> <output id="told"></output></p>
<input id="time" type="range" min="0" max="$last_scan" value="0" step="1">
$above
<h2>Map in 3-D</h2>
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
  slider.addEventListener("input", show);
  window.addEventListener("load", show);
})();
</script>
</body>
</html>
"""
