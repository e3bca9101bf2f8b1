// Colours of what is drawn; style.css has those of the words. Both themes are made to be read in sunlight.

const STATES = { light: ["#087f23", "#b35c00", "#b35c00", "#c1121f"], dark: ["#4ade80", "#ffb020", "#ffb020", "#ff5a4f"] };
const themes = {
  light: {
    ground: "#f3f6f9", grid: "#dbe3ea", card: "#ffffffee", ink: "#0a1420", halo: "#ffffff", muted: "#6b7785",
    trail: "#d6006c", vehicle: "#e8590c", mark: "#0b5ed7", walls: ["#9db4cc", "#0b2545"], water: "#ffffff",
    ring: "#0a142026", ringInk: "#46525f", sweep: "#e8590ccc", echo: "#f08c00",
    sonar: [[255, 255, 255, 0], [255, 214, 120, 150], [240, 120, 20, 230], [150, 30, 10, 255], [40, 0, 0, 255]],
  },
  dark: {
    ground: "#0a1118", grid: "#182430", card: "#16212cee", ink: "#f2f7fb", halo: "#05090d", muted: "#8b98a5",
    trail: "#ff4fa0", vehicle: "#ffb000", mark: "#6cc4ff", walls: ["#2c5a73", "#d6f4ff"], water: "#05090d",
    ring: "#ffffff2e", ringInk: "#b9c5d0", sweep: "#ffd27acc", echo: "#ff9d2e",
    sonar: [[0, 0, 0, 0], [90, 40, 5, 200], [215, 110, 15, 240], [255, 205, 90, 255], [255, 255, 235, 255]],
  },
};

function mixed(from, to, share) {
  const parts = [from, to].map((color) => [1, 3, 5].map((at) => parseInt(color.slice(at, at + 2), 16)));
  return `rgb(${parts[0].map((value, i) => Math.round(value + share * (parts[1][i] - value))).join(" ")})`;
}

// 256 words of a canvas's pixels, alpha first.
function ramp(stops) {
  return Uint32Array.from({ length: 256 }, (_, i) => {
    const at = Math.sqrt(i / 255) * (stops.length - 1), low = Math.min(Math.floor(at), stops.length - 2), share = at - low;
    const [r, g, b, a] = stops[low].map((value, j) => Math.round(value + share * (stops[low + 1][j] - value)));
    return ((a << 24) | (b << 16) | (g << 8) | r) >>> 0;
  });
}

export function palette(theme) {
  const colors = themes[theme] || themes.light;
  return {
    ...colors, states: STATES[theme] || STATES.light, sonar: ramp(colors.sonar),
    walls: Array.from({ length: 32 }, (_, i) => mixed(...colors.walls, i / 31)),
  };
}
