// SPDX-License-Identifier: Apache-2.0
// The rig from anywhere: cameras, static scene, objects with their trails and uncertainty, stereo points, zones.

import { Camera, fetchJson, PoseEvent, State, TrackState } from "./api";
import { byId, make, show } from "./dom";
import { add, axesOf, cross, dot, halfAxes, length, lookAt, Matrix, minus, multiply, perspective, poseMatrix, project,
  Quaternion, rotate, times, unit, Vector } from "./matrix";
import { makeSurface, Mesh, readMesh, Rgb, Surface } from "./surface";

interface Box { min: Vector; max: Vector }
interface Scene {
  calibration: string; content: string; scene_triangles: number; volume?: Box; zones: (Box & { name: string })[];
  cameras: { name: string; corners: Vector[]; world_from_camera: { translation_m: Vector; rotation_wxyz: Quaternion } }[];
  objects: { name: string; triangles: number; center_m: Vector; radius_m: number }[];
}
interface Body { mesh: Mesh | null; radius: number; pose: PoseEvent | null; trail: { time: number; place: Vector }[] }

const TRAIL_MS = 10_000;
const FRAME_MS = 33;
const POINTS_MS = 1000;
const MEASURED_MS = 500;  // a camera measures that took part so lately
const STILL: Matrix = poseMatrix([0, 0, 0], [1, 0, 0, 0]);
const LOOKS: Record<TrackState, string> =
  { searching: "--soft", tracking: "--good", degraded: "--weak", coasting: "--coast", lost: "--bad" };

export class ScenePanel {
  private readonly frame = make("div", "view");
  private readonly canvas = make("canvas");
  private readonly labels = make("canvas", "labels");
  private readonly note = make("p", "why");
  private readonly surface: Surface | null;
  private scene: Scene | null = null;
  private state: State | null = null;
  private still: Mesh | null = null;
  private readonly bodies = new Map<string, Body>();
  private points: number[] = [];
  private readonly measured = new Map<string, number>();  // [ms] by camera
  private colors = new Map<string, Rgb>();
  // The view: a point, and from where it is looked at.
  private target: Vector = [0, 0, 0];
  private up: Vector = [0, 0, 1];
  private turn = 0;   // [rad] about `up`
  private tilt = 0.5;  // [rad] above the horizon
  private distance = 2;
  private size = 1;   // of what there is to see [m]
  private shown = false;
  private stale = true;
  private drawn = 0;
  private asked = "";

  constructor() {
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("role", "img");
    this.labels.setAttribute("aria-hidden", "true");
    this.frame.append(this.canvas, this.labels);
    const home = make("button", "", "Reset view");
    home.type = "button";
    home.addEventListener("click", () => this.goHome());
    const bar = make("div", "do");
    bar.append(home, make("p", "facts", "Drag turns, wheel or two fingers go nearer, Shift moves; also arrow keys, + and -."));
    this.note.hidden = true;
    byId("scene").append(this.frame, this.note, bar);
    this.surface = makeSurface(this.canvas);
    if (!this.surface) show(this.note, "This browser draws no 3D scene: WebGL does not work in it.");
    else if (!this.surface.solid) show(this.note, "Lines only: this browser has no WebGL.");
    this.listen();
  }

  start(): void {
    if (!this.surface) return;
    new IntersectionObserver((entries) => {
      this.shown = entries[entries.length - 1].isIntersecting;
      this.stale = true;
    }).observe(this.frame);
    new ResizeObserver(() => { this.stale = true; }).observe(this.frame);
    const turn = (now: number) => {
      if (this.shown && this.stale && now - this.drawn >= FRAME_MS && this.scene) {
        this.drawn = now;
        this.stale = false;
        this.draw();
      }
      requestAnimationFrame(turn);
    };
    requestAnimationFrame(turn);
    setInterval(() => void this.fetchPoints(), POINTS_MS);
  }

  takeState(state: State): void {
    this.state = state;
    this.stale = true;
    const content = `${state.config.loaded} ${state.config.content}`;
    if (content === this.asked || !this.surface) return;
    this.asked = content;
    void this.fetchScene();
  }

  takePose(pose: PoseEvent): void {
    const body = this.bodies.get(pose.object), now = performance.now();
    for (const camera of pose.cameras ?? []) this.measured.set(camera, now);
    if (!body) return;
    body.pose = pose;
    if (pose.translation_m) {
      const last = body.trail[body.trail.length - 1];
      if (!last || length(minus(last.place, pose.translation_m)) > this.size * 1e-3) {
        body.trail.push({ time: now, place: pose.translation_m });
      }
    }
    while (body.trail.length > 0 && body.trail[0].time < now - TRAIL_MS) body.trail.shift();
    this.stale = true;
  }

  themed(): void {
    this.colors = new Map();
    this.stale = true;
  }

  private async fetchScene(): Promise<void> {
    const scene = await fetchJson<Scene>("api/v1/scene");
    if (!scene) {
      this.asked = "";  // with the next state again
      return;
    }
    const first = this.scene === null;
    this.scene = scene;
    for (const name of this.bodies.keys()) if (!scene.objects.some((one) => one.name === name)) this.bodies.delete(name);
    this.still = scene.scene_triangles > 0 ? await this.fetchMesh("api/v1/scene/mesh") : null;
    for (const { name, radius_m } of scene.objects) {
      const mesh = await this.fetchMesh(`api/v1/objects/${encodeURIComponent(name)}/mesh`);
      const known = this.bodies.get(name);
      this.bodies.set(name, { mesh, radius: radius_m, pose: known?.pose ?? null, trail: known?.trail ?? [] });
    }
    this.canvas.setAttribute("aria-label", `The scene in 3D: ${scene.cameras.length} cameras, objects ` +
      `${scene.objects.map((one) => one.name).join(", ") || "none"}`);
    this.canvas.dataset.bodies = String([...this.bodies.values()].filter((body) => body.mesh).length);
    if (first) this.goHome();
    this.stale = true;
  }

  private async fetchMesh(path: string): Promise<Mesh | null> {
    try {
      const answer = await fetch(path);
      return answer.ok ? readMesh(await answer.arrayBuffer()) : null;
    } catch {
      return null;  // the rest is worth seeing without
    }
  }

  private async fetchPoints(): Promise<void> {
    const tracked = this.state?.objects.some((object) => object.points !== undefined) === true;
    if (!this.shown || document.hidden) return;
    const had = this.points.length;
    const now = tracked ? await fetchJson<{ points_m: Vector[] }>("api/v1/points") : null;
    this.points = (now?.points_m ?? []).flatMap((place) => [...place, 1]);
    if (had + this.points.length > 0) this.stale = true;
  }

  /** Where a camera looks that stands behind all others. */
  private goHome(): void {
    const scene = this.scene;
    if (!scene || scene.cameras.length === 0) return;
    const eyes = scene.cameras.map((camera) => camera.world_from_camera.translation_m);
    const axes = scene.cameras.map((camera) => axesOf(camera.world_from_camera.rotation_wxyz));
    const mean = (all: Vector[]): Vector => times(all.reduce(add), 1 / all.length);
    const ahead = unit(mean(axes.map((one) => one[2]))), above = mean(axes.map((one) => times(one[1], -1)));
    // The world's axis that is up for the cameras; Z in doubt.
    const [k] = ([2, 1, 0] as const).map((i) => [i, Math.abs(above[i]) + (i === 2 ? 0.2 : 0)] as const)
      .reduce((best, one) => one[1] > best[1] ? one : best);
    this.up = [0, 0, 0];
    this.up[k] = above[k] < 0 ? -1 : 1;
    const middle = mean(eyes);
    const placed = [...this.bodies.values()].flatMap((body) => body.pose?.translation_m ? [body.pose.translation_m] : []);
    const reach = Math.max(...eyes.map((eye) => length(minus(eye, middle))), 0.3);
    this.target = placed.length > 0 ? mean(placed) : add(middle, times(ahead, 2 * reach));
    this.size = Math.max(...eyes.map((eye) => length(minus(eye, this.target))), 0.3);
    this.distance = 2.1 * this.size;
    const [side, front] = this.horizon();
    const from = times(ahead, -1);
    this.turn = Math.atan2(dot(from, front), dot(from, side)) + 0.35;
    this.tilt = Math.min(Math.max(Math.asin(Math.min(Math.max(dot(from, this.up), -1), 1)) + 0.25, -1.2), 1.2);
    this.stale = true;
  }

  /** Two directions square to `up`. */
  private horizon(): [Vector, Vector] {
    const side = unit(cross(Math.abs(this.up[0]) > 0.5 ? [0, 1, 0] : [1, 0, 0], this.up));
    return [side, cross(this.up, side)];
  }

  private away(): Vector {
    const [side, front] = this.horizon(), c = Math.cos(this.tilt);
    return add(times(this.up, Math.sin(this.tilt)), add(times(side, c * Math.cos(this.turn)), times(front, c * Math.sin(this.turn))));
  }

  private move(dx: number, dy: number, shift: boolean): void {
    if (shift) {
      const away = this.away(), right = unit(cross(this.up, away)), above = cross(away, right), scale = this.distance / 500;
      this.target = add(this.target, add(times(right, -dx * scale), times(above, dy * scale)));
    } else {
      this.turn -= dx * 0.008;
      this.tilt = Math.min(Math.max(this.tilt + dy * 0.008, -1.5), 1.5);
    }
    this.stale = true;
  }

  private zoom(factor: number): void {
    this.distance = Math.min(Math.max(this.distance * factor, 0.05 * this.size), 20 * this.size);
    this.stale = true;
  }

  private listen(): void {
    const held = new Map<number, [number, number]>();
    const spread = () => {
      const [a, b] = [...held.values()];
      return b ? Math.hypot(a[0] - b[0], a[1] - b[1]) : 0;
    };
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      held.set(event.pointerId, [event.clientX, event.clientY]);
    });
    this.canvas.addEventListener("pointermove", (event) => {
      const before = held.get(event.pointerId);
      if (!before) return;
      const wide = spread();
      held.set(event.pointerId, [event.clientX, event.clientY]);
      if (held.size === 2 && wide > 0) this.zoom(wide / Math.max(spread(), 1));
      else this.move(event.clientX - before[0], event.clientY - before[1], event.shiftKey || event.buttons === 2);
    });
    for (const kind of ["pointerup", "pointercancel"] as const) {
      this.canvas.addEventListener(kind, (event) => held.delete(event.pointerId));
    }
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(event.deltaY * 0.001));
    }, { passive: false });
    this.canvas.addEventListener("keydown", (event) => {
      const moves: Record<string, [number, number]> =
        { ArrowLeft: [-25, 0], ArrowRight: [25, 0], ArrowUp: [0, -25], ArrowDown: [0, 25] };
      const move = moves[event.key];
      if (move) this.move(...move, event.shiftKey);
      else if (event.key === "+") this.zoom(0.85);
      else if (event.key === "-") this.zoom(1 / 0.85);
      else return;
      event.preventDefault();
    });
  }

  private color(name: string): Rgb {
    const known = this.colors.get(name);
    if (known) return known;
    const text = getComputedStyle(document.documentElement).getPropertyValue(name).trim().replace("#", "");
    const digits = text.length === 3 ? [...text].map((digit) => digit + digit).join("") : text;
    const color = [0, 2, 4].map((at) => parseInt(digits.slice(at, at + 2), 16) / 255) as Rgb;
    this.colors.set(name, color);
    return color;
  }

  private draw(): void {
    const surface = this.surface, scene = this.scene;
    const width = this.frame.clientWidth, height = this.frame.clientHeight, scale = Math.min(window.devicePixelRatio || 1, 2);
    if (!surface || !scene || width === 0) return;
    for (const canvas of [this.canvas, this.labels]) {
      const [w, h] = [Math.round(width * scale), Math.round(height * scale)];
      if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
    }
    const eye = add(this.target, times(this.away(), this.distance));
    const view = multiply(perspective(0.7, width / height, this.distance / 50, this.distance * 50 + 20 * this.size),
      lookAt(eye, this.target, this.up));
    surface.begin(view, this.color("--card"));
    this.drawGround(surface);
    if (this.still) surface.mesh(this.still, STILL, this.color("--solid"));
    const labels: [Vector, string, string][] = [];
    this.drawCameras(surface, scene, labels);
    for (const [name, body] of this.bodies) this.drawBody(surface, name, body, labels);
    surface.points(this.points, this.color("--accent"), 3 * scale);
    if (scene.volume) surface.lines(boxLines(scene.volume, 0.35), this.color("--soft"));
    for (const zone of scene.zones) {
      const inside = this.state?.objects.some((object) => object.zones?.includes(zone.name)) === true;
      const look = inside ? "--good" : "--accent";
      surface.lines(boxLines(zone, 0.9), this.color(look));
      labels.push([[zone.min[0], zone.min[1], zone.max[2]], zone.name, look]);
    }
    this.drawLabels(view, labels, scale);
    this.canvas.dataset.view = [this.turn, this.tilt, this.distance].map((v) => v.toFixed(4)).join(" ");
    this.canvas.dataset.frames = String(Number(this.canvas.dataset.frames ?? 0) + 1);
  }

  /** Lines of the ground through the world's origin, in steps of 1, 2 or 5; the world's axes. */
  private drawGround(surface: Surface): void {
    const raw = this.size / 5, power = 10 ** Math.floor(Math.log10(raw));
    const step = power * ([1, 2, 5].find((one) => one * power >= raw) ?? 10), reach = 10 * step;
    const [side, front] = this.horizon(), ends: number[] = [];
    for (let i = -10; i <= 10; ++i) {
      const opacity = i === 0 ? 0.8 : 0.4;
      for (const [a, b] of [[side, front], [front, side]]) {
        ends.push(...add(times(a, i * step), times(b, -reach)), opacity, ...add(times(a, i * step), times(b, reach)), opacity);
      }
    }
    surface.lines(ends, this.color("--line"));
    (["--bad", "--good", "--coast"] as const).forEach((name, k) => {
      const end: Vector = [0, 0, 0];
      end[k] = step;
      surface.lines([0, 0, 0, 1, ...end, 1], this.color(name));
    });
  }

  private drawCameras(surface: Surface, scene: Scene, labels: [Vector, string, string][]): void {
    const now = performance.now(), depth = 0.16 * this.size;
    for (const camera of scene.cameras) {
      const { translation_m: eye, rotation_wxyz: q } = camera.world_from_camera;
      const known = this.state?.cameras.find((one: Camera) => one.name === camera.name);
      const measuring = now - (this.measured.get(camera.name) ?? -Infinity) < MEASURED_MS;
      const look = known && !known.present ? "--bad" : measuring ? "--good" : "--soft";
      const corners = camera.corners.map((ray) => add(eye, rotate(q, times(ray, depth / Math.max(ray[2], 0.3)))));
      const ends: number[] = [];
      corners.forEach((corner, i) => ends.push(...eye, 1, ...corner, 1, ...corner, 1, ...corners[(i + 1) % 4], 1));
      // Which side is up.
      const above = add(times(add(corners[0], corners[1]), 0.5), times(axesOf(q)[1], -0.04 * this.size));
      ends.push(...corners[0], 1, ...above, 1, ...above, 1, ...corners[1], 1);
      surface.lines(ends, this.color(look));
      labels.push([eye, camera.name, look]);
    }
  }

  private drawBody(surface: Surface, name: string, body: Body, labels: [Vector, string, string][]): void {
    const now = performance.now(), ends: number[] = [], pose = body.pose;
    for (let i = 1; i < body.trail.length; ++i) {
      const [a, b] = [body.trail[i - 1], body.trail[i]];
      const opacity = (time: number) => Math.max(0, 1 - (now - time) / TRAIL_MS);
      ends.push(...a.place, opacity(a.time), ...b.place, opacity(b.time));
    }
    surface.lines(ends, this.color("--accent"));
    if (!pose?.translation_m || !pose.rotation_wxyz) return;
    const t = pose.translation_m, look = LOOKS[pose.state];
    if (body.mesh) surface.mesh(body.mesh, poseMatrix(t, pose.rotation_wxyz), this.color(look));
    const axes = axesOf(pose.rotation_wxyz);
    (["--bad", "--good", "--coast"] as const).forEach((color, k) =>
      surface.lines([...t, 1, ...add(t, times(axes[k], 1.3 * body.radius)), 1], this.color(color)));
    const shown = pose.covariance ? this.drawUncertainty(surface, t, axes, pose.covariance, body.radius) : "";
    labels.push([add(t, times(this.up, 1.2 * body.radius)), `${name}: ${pose.state}${shown}`, look]);
  }

  /** Two sigmas of the position, enlarged by a power of ten until they can be seen. */
  private drawUncertainty(surface: Surface, t: Vector, axes: Vector[], covariance: number[], radius: number): string {
    const block = [3, 4, 5].map((row) => [3, 4, 5].map((column) => covariance[6 * row + column]));
    const half = halfAxes(block).map((axis) =>
      times(add(add(times(axes[0], axis[0]), times(axes[1], axis[1])), times(axes[2], axis[2])), 2));
    const largest = Math.max(...half.map(length));
    if (!(largest > 1e-9)) return "";
    const factor = 10 ** Math.max(0, Math.ceil(Math.log10(0.25 * radius / largest)));
    const ends: number[] = [];
    for (const [a, b] of [[0, 1], [0, 2], [1, 2]]) {
      for (let i = 0; i < 32; ++i) {
        for (const k of [i, i + 1]) {
          const angle = 2 * Math.PI * k / 32;
          const out = add(times(half[a], factor * Math.cos(angle)), times(half[b], factor * Math.sin(angle)));
          ends.push(...add(t, out), 1);
        }
      }
    }
    surface.lines(ends, this.color("--ink"), true);
    return `, 2σ${factor > 1 ? ` ×${factor}` : ""}`;
  }

  private drawLabels(view: Matrix, labels: [Vector, string, string][], scale: number): void {
    const g = this.labels.getContext("2d");
    if (!g) return;
    const { width, height } = this.labels;
    g.clearRect(0, 0, width, height);
    g.font = `${12 * scale}px system-ui, "DejaVu Sans", sans-serif`;
    g.textAlign = "center";
    g.lineJoin = "round";
    g.lineWidth = 4 * scale;
    for (const [place, text, look] of labels) {
      const [x, y, w] = project(view, place);
      if (w <= 0) continue;
      const at: [number, number] = [(x / w + 1) / 2 * width, (1 - y / w) / 2 * height - 6 * scale];
      g.strokeStyle = this.css("--card");
      g.fillStyle = this.css(look);
      g.strokeText(text, ...at);
      g.fillText(text, ...at);
    }
  }

  private css(name: string): string {
    return `rgb(${this.color(name).map((value) => Math.round(255 * value)).join(" ")})`;
  }
}

function boxLines(box: Box, opacity: number): number[] {
  const corner = (i: number) => [0, 1, 2].map((k) => (i >> k & 1 ? box.max : box.min)[k]);
  const ends: number[] = [];
  for (let i = 0; i < 8; ++i) {
    for (const bit of [1, 2, 4]) if (!(i & bit)) ends.push(...corner(i), opacity, ...corner(i | bit), opacity);
  }
  return ends;
}
