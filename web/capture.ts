// SPDX-License-Identifier: Apache-2.0
// Views of a calibration target, captured by the cameras that run: what is missing next in plain words, what each picture has
// covered as a grid over it, links between cameras, and what came of it.

import { fetchJson, order } from "./api";
import { byId, make, setText, show } from "./dom";

const BUSY_MS = 400, IDLE_MS = 2000;
const FULL = 6;  // corners in a cell that count as many
const SVG = "http://www.w3.org/2000/svg";

type Side = "left" | "right" | "top" | "bottom";
interface CapturedCamera {
  name: string; width: number; height: number; images: number; views: number; views_needed: number; lens_known: boolean;
  coverage: number; depth_ratio: number; tilted: Record<Side, boolean>; complete: boolean; columns: number; rows: number; cells: number[];
  problem?: string;
}
interface Capture {
  state: "off" | "running" | "solving" | "done" | "failed"; words: string; hint: string; share: number; sets: number; target: string;
  folder: string; since: string; wanted?: { camera: string; column?: number; row?: number }; cameras: CapturedCamera[];
  links_needed: number; links: { cameras: [string, string]; sets: number }[]; grade?: string; remarks?: string[];
}

function draw(kind: "rect", attributes: Record<string, number | string>): SVGElement {
  const element = document.createElementNS(SVG, kind);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
  return element;
}

export class CapturePanel {
  private readonly words = make("p", "words");
  private readonly hint = make("p", "hint");
  private readonly share = make("progress");
  private readonly sets = make("p", "facts");
  private readonly cameras = make("ul", "places");
  private readonly links = make("p", "facts");
  private readonly stop = make("button", "", "Stop and solve");
  private readonly close = make("button", "", "Close");
  private readonly report = make("a", "", "Report");
  private readonly form = make("form", "capture-form");
  private readonly target = make("select");
  private readonly file = make("input");
  private readonly flags = new Map<"keep_lenses" | "moving" | "readouts" | "resume", HTMLInputElement>();
  private readonly begin = make("button", "", "Start");
  private readonly open = make("button", "", "Capture views of a target");
  private readonly grids = new Map<string, SVGElement>();
  private shown = "";   // what the grids show
  private taken = -1;   // sets, when it was looked at last
  private closed = "";  // the capture whose end was read
  private turn = 0;

  /** `frameOf`: where the picture of a camera is, if it has one. */
  constructor(private readonly tell: (text: string) => void, private readonly frameOf: (camera: string) => HTMLElement | null) {
    this.words.setAttribute("role", "status");
    this.share.max = 100;
    this.share.setAttribute("aria-label", "What has been taken of what is needed");
    for (const button of [this.stop, this.close, this.open]) button.type = "button";
    this.stop.addEventListener("click", () => void this.give("stop", {}));
    this.close.addEventListener("click", () => {
      this.closed = byId("capture").dataset.since ?? "";
      void this.look();
    });
    this.report.href = "api/v1/calibration/capture/report";
    this.report.target = "_blank";
    this.report.rel = "noopener";
    const bar = make("div", "do");
    bar.append(this.stop, this.report, this.close);
    byId("capture").append(this.words, this.hint, this.share, this.sets, this.cameras, this.links, bar);
    this.makeForm();
  }

  private makeForm(): void {
    const choice = make("label", "", "Target");
    this.target.setAttribute("aria-label", "Target that is shown");
    choice.append(this.target);
    const other = make("label", "", "or its file");
    this.file.type = "file";
    this.file.accept = ".toml";
    other.append(this.file);
    const marks = make("fieldset", "marks");
    marks.append(make("legend", "", "Capture"));
    for (const [key, text] of [["keep_lenses", "keep the lenses"], ["moving", "board in motion"], ["readouts", "solve for rolling shutters"], ["resume", "go on with the last"]] as const) {
      const box = make("input"), label = make("label");
      box.type = "checkbox";
      label.append(box, text);
      this.flags.set(key, box);
      marks.append(label);
    }
    // Read-outs are told by a board in motion alone.
    const moving = this.flags.get("moving"), readouts = this.flags.get("readouts");
    readouts?.addEventListener("change", () => { if (moving && readouts.checked) moving.checked = true; });
    moving?.addEventListener("change", () => { if (readouts && !moving.checked) readouts.checked = false; });
    this.begin.type = "submit";
    const bar = make("div", "do");
    bar.append(this.begin);
    this.form.append(choice, other, marks, bar);
    this.form.hidden = true;
    this.open.setAttribute("aria-expanded", "false");
    this.open.addEventListener("click", () => void this.unfold(this.form.hidden));
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      void this.start();
    });
    const opener = make("div", "do");
    opener.append(this.open);
    byId("calibration").append(opener, this.form);
  }

  watch(): void {
    const turn = async () => {
      if (!document.hidden) await this.look();
      setTimeout(() => void turn(), this.turn);
    };
    void turn();
  }

  private async unfold(on: boolean): Promise<void> {
    this.form.hidden = !on;
    this.open.setAttribute("aria-expanded", String(on));
    if (!on) return;
    const targets = await fetchJson<{ name: string; words: string }[]>("api/v1/calibration/capture/targets") ?? [];
    this.target.replaceChildren(...targets.map(({ name, words }) => {
      const option = make("option", "", `${name}: ${words}`);
      option.value = name;
      return option;
    }));
    this.target.disabled = targets.length === 0;
    if (targets.length === 0) this.target.append(make("option", "", "none beside the installation file"));
  }

  private async start(): Promise<void> {
    const wanted: Record<string, unknown> = {};
    for (const [key, box] of this.flags) if (box.checked) wanted[key] = true;
    const file = this.file.files?.[0];
    if (file) wanted.target_toml = await file.text();
    else if (!this.target.disabled) wanted.target = this.target.value;
    if (await this.give("start", wanted)) {
      this.file.value = "";
      await this.unfold(false);
      byId("capture").scrollIntoView({ block: "nearest" });
    }
  }

  private async give(what: "start" | "stop", body: unknown): Promise<boolean> {
    const wrong = await order(`api/v1/calibration/capture/${what}`, body);
    this.tell(wrong ? `capture: ${what} refused: ${wrong}` : `capture: ${what}`);
    await this.look();
    return wrong === null;
  }

  private async look(): Promise<void> {
    const capture = await fetchJson<Capture>("api/v1/calibration/capture");
    if (capture) this.take(capture);
  }

  private take(capture: Capture): void {
    const busy = capture.state === "running" || capture.state === "solving", panel = byId("capture");
    this.turn = busy ? BUSY_MS : IDLE_MS;
    this.open.disabled = busy;
    panel.hidden = capture.state === "off" || (!busy && capture.since === this.closed);
    if (panel.hidden) return this.cover([], undefined);
    panel.dataset.since = capture.since;
    panel.dataset.state = capture.state;
    setText(this.words, capture.words);
    this.words.className = `words ${capture.state === "failed" ? "bad" : capture.grade === "good" ? "good" : ""}`;
    show(this.hint, capture.hint);
    this.share.value = Math.floor(100 * capture.share);
    setText(this.sets, `${capture.sets} ${capture.sets === 1 ? "set" : "sets"}, ${this.share.value} % of what is needed · ` +
      `${capture.target} · ${capture.folder.split("/").slice(-2).join("/")}`);
    this.sets.title = capture.folder;
    this.list(capture);
    this.stop.hidden = capture.state !== "running";
    this.close.hidden = busy;
    this.report.hidden = capture.grade === undefined;
    this.flash(panel, capture.sets);
    this.cover(busy ? capture.cameras : [], capture.wanted);
  }

  private list(capture: Capture): void {
    const lines = capture.state === "done" ? (capture.remarks ?? []).map((text) => [text, ""]) :
      capture.cameras.map((camera) => [`${camera.name}: ${this.needs(camera)}`, camera.complete ? "✓" : "○"]);
    const now = JSON.stringify(lines);
    if (this.cameras.dataset.shown !== now) {
      this.cameras.dataset.shown = now;
      this.cameras.replaceChildren(...lines.map(([text, mark]) => {
        const line = make("li");
        line.append(make("span", "", text));
        if (mark) line.append(make("span", `chip ${mark === "✓" ? "good" : "weak"}`, mark === "✓" ? "✓ complete" : "○ going on"));
        return line;
      }));
    }
    const links = capture.links.map(({ cameras: [a, b], sets }) => `${a} and ${b} ${sets}×`);
    show(this.links, capture.cameras.length > 1 && capture.state !== "done"
      ? `Seen together, ${capture.links_needed}× are needed: ${links.join(", ") || "not yet"}` : "");
  }

  private needs(camera: CapturedCamera): string {
    if (camera.problem) return camera.problem;
    const parts = [`${camera.views} of ${camera.views_needed} views`, `${Math.round(100 * camera.coverage)} % covered`];
    if (!camera.lens_known) {
      const missing = (Object.keys(camera.tilted) as Side[]).filter((side) => !camera.tilted[side]);
      parts.push(`near and far ${camera.depth_ratio.toFixed(1)}×`,
        missing.length === 0 ? "tilted to all sides" : `not tilted yet: ${missing.join(", ")}`);
    }
    return parts.join(", ");
  }

  /** Who holds the target looks at it, not here. */
  private flash(panel: HTMLElement, sets: number): void {
    if (this.taken >= 0 && sets > this.taken) {
      panel.classList.add("taken");
      setTimeout(() => panel.classList.remove("taken"), 700);
      const { userActivation } = navigator as { userActivation?: { hasBeenActive: boolean } };
      if (userActivation?.hasBeenActive) navigator.vibrate?.(150);  // before a tap it would be an error
    }
    this.taken = sets;
  }

  /** The grid over each picture; of cameras that have none, below the words. */
  private cover(cameras: CapturedCamera[], wanted: Capture["wanted"]): void {
    const now = JSON.stringify([cameras.map(({ name, cells, width }) => [name, width, cells, this.frameOf(name) !== null]), wanted]);
    if (now === this.shown) return;
    this.shown = now;
    for (const grid of this.grids.values()) grid.remove();
    this.grids.clear();
    for (const camera of cameras) {
      if (camera.width === 0) continue;
      const grid = this.gridOf(camera, wanted?.camera === camera.name ? wanted : undefined);
      this.grids.set(camera.name, grid);
      const frame = this.frameOf(camera.name);
      if (frame) frame.append(grid); else byId("capture").append(grid);
    }
  }

  private gridOf(camera: CapturedCamera, wanted: Capture["wanted"]): SVGElement {
    const grid = document.createElementNS(SVG, "svg"), { width, height, columns, rows } = camera;
    grid.setAttribute("class", "coverage");
    grid.setAttribute("viewBox", `0 0 ${width} ${height}`);
    grid.setAttribute("role", "img");
    grid.setAttribute("aria-label", `Coverage of camera ${camera.name}: ${Math.round(100 * camera.coverage)} %`);
    const dx = width / columns, dy = height / rows;
    camera.cells.forEach((corners, i) => {
      grid.append(draw("rect", { class: corners > 0 ? "seen" : "cell", x: (i % columns) * dx, y: Math.floor(i / columns) * dy,
        width: dx, height: dy, "fill-opacity": corners > 0 ? 0.2 + 0.4 * Math.min(1, corners / FULL) : 0 }));
    });
    if (wanted?.column !== undefined && wanted.row !== undefined) {
      const edge = width / 160;
      grid.append(draw("rect", { class: "wanted", x: (wanted.column * width) / 3 + edge, y: (wanted.row * height) / 3 + edge,
        width: width / 3 - 2 * edge, height: height / 3 - 2 * edge, "stroke-width": edge, "stroke-dasharray": `${3 * edge} ${2 * edge}` }));
    }
    return grid;
  }
}
