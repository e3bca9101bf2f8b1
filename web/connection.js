// The link to the vehicle: messages in, requests out. src/web_page/messages.py writes and reads the same.

const SILENT = 3000;  // ms without a message: the link is cut
const PATIENCE = 6000;  // ms without one, or until an attempt opens: it is tried anew; a full link takes some of them
const RETRY = 1000;   // ms between two attempts
const TURN = 65536;   // steps of an angle of 16 bits

const readers = {
  1: (view, buffer) => {
    const n = view.getUint16(2, true), wide = 2 * n;
    return ["tile", {
      x: view.getInt16(4, true), y: view.getInt16(6, true),
      index: new Uint16Array(buffer, 8, n), born: new Uint16Array(buffer, 8 + wide, n),
      level: new Uint8Array(buffer, 8 + 2 * wide, n), within: new Uint8Array(buffer, 8 + 2 * wide + n, n),
    }];
  },
  2: (view, buffer) => ["beam", {
    reach: view.getFloat32(4, true), width: angle(view, 2), fromBow: angle(view, 8), inMap: angle(view, 10),
    x: view.getFloat32(12, true), y: view.getFloat32(16, true), strengths: new Uint8Array(buffer, 20, view.getUint8(1)),
  }],
  3: (view, buffer) => ["track", rows(view, buffer)],
  4: (view, buffer) => ["fixes", rows(view, buffer)],
};

function angle(view, at) {
  return view.getUint16(at, true) / TURN * 2 * Math.PI;
}

function rows(view, buffer) {
  const columns = view.getUint8(1), n = view.getUint16(2, true), all = new Float32Array(buffer, 8, columns * n);
  return { chunk: view.getUint32(4, true), rows: Array.from({ length: n }, (_, i) => all.subarray(i * columns, (i + 1) * columns)) };
}

export class Connection {
  // take(kind, content) gets every message. known() returns {run, revision} of what is shown.
  constructor(take, known) {
    Object.assign(this, { take, known, heard: performance.now(), socket: null, refused: "" });
    this.open();
    setInterval(() => this.watch(), RETRY);
  }

  get silence() {  // s
    return (performance.now() - this.heard) / 1000;
  }

  get isCut() {
    return performance.now() - this.heard > SILENT;
  }

  open() {
    const url = new URL("live", location.href);
    url.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    url.search = url.hash = "";
    const socket = this.socket = new WebSocket(url);
    this.opened = performance.now();
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.opened = performance.now();
      this.send({ hello: this.known() });
    };
    socket.onmessage = (event) => { if (socket === this.socket) this.read(event.data); };
    socket.onclose = (event) => { this.refused = event.reason || ""; };
  }

  read(data) {
    this.heard = performance.now();
    if (typeof data === "string") {
      for (const [kind, content] of Object.entries(JSON.parse(data))) this.take(kind, content);
    } else {
      const view = new DataView(data), reader = readers[view.getUint8(0)];
      if (reader) this.take(...reader(view, data));
    }
  }

  watch() {
    const waited = performance.now() - Math.max(this.opened, this.heard);
    if (this.socket.readyState < WebSocket.CLOSING && waited < PATIENCE) return;
    const old = this.socket;
    this.socket = null;
    old.onclose = null;
    old.close();
    this.open();
  }

  send(request) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(request));
  }
}
