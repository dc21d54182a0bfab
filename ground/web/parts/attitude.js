// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// <attitude-view>: the satellite as it lies in inertial space, from its quaternion (body to inertial, scalar last): a body with two panels,
// its axes, the direction to the sun, the magnetic field, and the target. Drag or arrow keys turn the viewpoint.

const body = box(0, 0, 0, 0.42, 0.42, 0.62);
const panels = [box(1.0, 0, 0, 0.5, 0.03, 0.42), box(-1.0, 0, 0, 0.5, 0.03, 0.42)];

export class AttitudeView extends HTMLElement {
  constructor() {
    super();
    this.eye = { yaw: 0.6, pitch: 0.35 };
    this.state = null;
  }

  connectedCallback() {
    if (this.canvas) return;
    this.canvas = document.createElement("canvas");
    this.append(this.canvas);
    this.tabIndex = 0;
    this.setAttribute("role", "img");
    this.observer = new ResizeObserver(() => this.#resize());
    this.observer.observe(this);
    this.addEventListener("pointerdown", (event) => {
      this.setPointerCapture(event.pointerId);
      this.from = { x: event.clientX, y: event.clientY, ...this.eye };
    });
    this.addEventListener("pointermove", (event) => {
      if (!this.from) return;
      this.#turn(this.from.yaw + (event.clientX - this.from.x) * 0.01, this.from.pitch + (event.clientY - this.from.y) * 0.01);
    });
    this.addEventListener("pointerup", () => {
      this.from = null;
    });
    this.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
      if (!step) return;
      event.preventDefault();
      this.#turn(this.eye.yaw + step[0], this.eye.pitch + step[1]);
    });
  }

  disconnectedCallback() {
    this.observer?.disconnect();
  }

  /** @p state: {q: [x, y, z, w], sun, field, rate (body frame, or null), eclipse, stale} */
  show(state) {
    this.state = state;
    this.setAttribute(
      "aria-label",
      state
        ? `Attitude: quaternion ${state.q.map((v) => v.toFixed(3)).join(", ")}${state.eclipse ? ", in eclipse" : ""}`
        : "Attitude: no quaternion yet",
    );
    this.draw();
  }

  draw() {
    if (this.waiting || !this.width) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      if (this.isConnected) this.#draw();
    });
  }

  #turn(yaw, pitch) {
    this.eye = { yaw, pitch: Math.max(-1.5, Math.min(1.5, pitch)) };
    this.draw();
  }

  #resize() {
    const rectangle = this.getBoundingClientRect();
    const scale = window.devicePixelRatio || 1;
    this.width = rectangle.width;
    this.height = rectangle.height;
    this.canvas.width = Math.round(this.width * scale);
    this.canvas.height = Math.round(this.height * scale);
    this.canvas.getContext("2d").setTransform(scale, 0, 0, scale, 0, 0);
    this.draw();
  }

  /** A point of inertial space on the canvas: {x, y, depth}; larger depth is nearer. */
  #project([x, y, z]) {
    const { yaw, pitch } = this.eye;
    const x1 = x * Math.cos(yaw) + y * Math.sin(yaw),
      y1 = -x * Math.sin(yaw) + y * Math.cos(yaw);
    const depth = -y1 * Math.cos(pitch) + z * Math.sin(pitch);
    const up = z * Math.cos(pitch) + y1 * Math.sin(pitch);
    const size = Math.min(this.width, this.height) * 0.26 * (1 + depth * 0.08);
    return { x: this.width / 2 + x1 * size, y: this.height / 2 - up * size, depth };
  }

  #draw() {
    const style = getComputedStyle(this);
    this.colour = (name) => style.getPropertyValue(name).trim();
    const ctx = this.canvas.getContext("2d");
    ctx.clearRect(0, 0, this.width, this.height);
    ctx.font = `${parseFloat(style.fontSize) * 0.85}px ${style.fontFamily}`;
    ctx.textAlign = "center";
    ctx.textBaseline = "middle";
    this.#draw_frame(ctx);
    if (!this.state) return;
    const turn = (v) => rotate(this.state.q, v);
    ctx.globalAlpha = this.state.stale ? 0.45 : 1;
    const things = [];
    for (const solid of [body, ...panels]) for (const face of solid) this.#add_face(things, face, turn, solid === body);
    this.#add_arrow(things, turn([1.9, 0, 0]), "x", "--series-2", []);
    this.#add_arrow(things, turn([0, 1.6, 0]), "y", "--series-3", []);
    this.#add_arrow(things, turn([0, 0, 1.6]), "z", "--series-1", []);
    if (this.state.sun && length(this.state.sun) > 0.1)
      this.#add_arrow(things, turn(scaled(this.state.sun, 2.0)), "sun", "--yellow", [2, 3]);
    if (this.state.field && length(this.state.field) > 0)
      this.#add_arrow(things, turn(scaled(this.state.field, 1.8)), "B", "--dim", [6, 4]);
    things.sort((a, b) => a.depth - b.depth).forEach((thing) => thing.draw(ctx));
    ctx.globalAlpha = 1;
  }

  /** The equator of inertial space and its axes, thin. */
  #draw_frame(ctx) {
    ctx.strokeStyle = this.colour("--line");
    ctx.fillStyle = this.colour("--dim");
    ctx.lineWidth = 1;
    ctx.beginPath();
    for (let i = 0; i <= 72; ++i) {
      const p = this.#project([2 * Math.cos((i * Math.PI) / 36), 2 * Math.sin((i * Math.PI) / 36), 0]);
      ctx.lineTo(p.x, p.y);
    }
    ctx.stroke();
    for (const [axis, name] of [
      [[2.15, 0, 0], "X"],
      [[0, 2.15, 0], "Y"],
      [[0, 0, 2.15], "Z"],
    ]) {
      const zero = this.#project([0, 0, 0]),
        end = this.#project(axis);
      ctx.beginPath();
      ctx.moveTo(zero.x, zero.y);
      ctx.lineTo(end.x, end.y);
      ctx.stroke();
      ctx.fillText(name, end.x, end.y);
    }
  }

  #add_face(things, face, turn, is_body) {
    const points = face.points.map((point) => this.#project(turn(point)));
    const towards = this.#project(turn(face.normal)).depth - this.#project([0, 0, 0]).depth;
    things.push({
      depth: points.reduce((sum, p) => sum + p.depth, 0) / points.length,
      draw: (ctx) => {
        ctx.beginPath();
        for (const p of points) ctx.lineTo(p.x, p.y);
        ctx.closePath();
        ctx.fillStyle = this.colour(is_body ? "--body" : "--solar");
        ctx.fill();
        ctx.fillStyle = this.colour("--panel");
        ctx.save();
        ctx.globalAlpha *= 0.5 * (1 - Math.max(0, towards));
        ctx.fill();
        ctx.restore();
        ctx.strokeStyle = this.colour("--text");
        ctx.lineWidth = 0.8;
        ctx.stroke();
      },
    });
  }

  #add_arrow(things, to, name, colour, dash) {
    const zero = this.#project([0, 0, 0]),
      end = this.#project(to),
      middle = this.#project(to.map((v) => v * 0.6));
    things.push({
      depth: middle.depth,
      draw: (ctx) => {
        ctx.strokeStyle = this.colour(colour);
        ctx.fillStyle = ctx.strokeStyle;
        ctx.lineWidth = 2;
        ctx.setLineDash(dash);
        ctx.beginPath();
        ctx.moveTo(zero.x, zero.y);
        ctx.lineTo(end.x, end.y);
        ctx.stroke();
        ctx.setLineDash([]);
        const angle = Math.atan2(end.y - zero.y, end.x - zero.x);
        ctx.beginPath();
        ctx.moveTo(end.x, end.y);
        ctx.lineTo(end.x - 9 * Math.cos(angle - 0.4), end.y - 9 * Math.sin(angle - 0.4));
        ctx.lineTo(end.x - 9 * Math.cos(angle + 0.4), end.y - 9 * Math.sin(angle + 0.4));
        ctx.fill();
        ctx.fillText(name, end.x + 13 * Math.cos(angle), end.y + 13 * Math.sin(angle));
      },
    });
  }
}

/** v turned by the unit quaternion [x, y, z, w]. */
export function rotate([x, y, z, w], [a, b, c]) {
  const tx = 2 * (y * c - z * b),
    ty = 2 * (z * a - x * c),
    tz = 2 * (x * b - y * a);
  return [a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx];
}

function length(v) {
  return Math.hypot(...v);
}

function scaled(v, size) {
  return v.map((part) => (part / length(v)) * size);
}

/** The six faces of a box around (cx, cy, cz) with half sizes. */
function box(cx, cy, cz, hx, hy, hz) {
  const faces = [];
  for (const axis of [0, 1, 2]) {
    for (const side of [-1, 1]) {
      const half = [hx, hy, hz],
        centre = [cx, cy, cz];
      const others = [0, 1, 2].filter((i) => i !== axis);
      const points = [
        [-1, -1],
        [1, -1],
        [1, 1],
        [-1, 1],
      ].map(([a, b]) => {
        const point = [...centre];
        point[axis] += side * half[axis];
        point[others[0]] += a * half[others[0]];
        point[others[1]] += b * half[others[1]];
        return point;
      });
      const normal = [0, 0, 0];
      normal[axis] = side;
      faces.push({ points, normal });
    }
  }
  return faces;
}

customElements.define("attitude-view", AttitudeView);
