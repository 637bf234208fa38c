// SPDX-License-Identifier: Apache-2.0
// Lines over the last minute.

const SPAN_MS = 60_000;
const MOST = 1200;  // points of a line

export interface Line { name: string; dash: number[]; color: string }

export class Plot {
  readonly element = document.createElement("figure");
  private readonly canvas = document.createElement("canvas");
  private readonly value = document.createElement("span");
  private readonly times: number[] = [];
  private readonly rows: number[][] = [];
  private last = 0;

  constructor(title: string, private readonly unit: string, private readonly lines: Line[], private readonly fromZero: boolean) {
    this.element.className = "plot";
    const caption = document.createElement("figcaption");
    const name = document.createElement("span");
    name.textContent = title;
    caption.append(name, this.value);
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `${title}, last minute`);
    this.element.append(caption, this.canvas);
  }

  /** One value for each line; null where it is not known. */
  add(values: (number | null)[]): void {
    const now = performance.now();
    if (now - this.last < SPAN_MS / MOST) return;
    this.last = now;
    this.times.push(now);
    this.rows.push(values.map((value) => value ?? NaN));
    while (this.times.length > 0 && this.times[0] < now - SPAN_MS) {
      this.times.shift();
      this.rows.shift();
    }
  }

  draw(): void {
    const scale = window.devicePixelRatio || 1;
    const width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    if (width === 0) return;
    this.canvas.width = Math.round(width * scale);
    this.canvas.height = Math.round(height * scale);
    const g = this.canvas.getContext("2d");
    if (!g) return;
    g.scale(scale, scale);
    const style = getComputedStyle(document.documentElement);
    const color = (name: string) => style.getPropertyValue(name).trim();
    const all = this.rows.flat().filter((value) => !Number.isNaN(value));
    let low = this.fromZero ? 0 : Math.min(...all), high = Math.max(...all);
    if (all.length === 0) [low, high] = [0, 1];
    const least = this.fromZero ? 0.5 : 0.01;
    if (high - low < least) [low, high] = this.fromZero ? [0, least] : [low - least / 2, high + least / 2];
    high += (high - low) * 0.08;
    this.axes(g, width, height, low, high, color("--line"), color("--soft"));
    const now = performance.now();
    this.lines.forEach((line, index) => {
      g.strokeStyle = color(line.color);
      g.lineWidth = 1.5;
      g.setLineDash(line.dash);
      g.beginPath();
      let pen = false;
      this.times.forEach((time, i) => {
        const value = this.rows[i][index];
        const known = !Number.isNaN(value) && (i === 0 || time - this.times[i - 1] < 1000);
        const x = width * (1 - (now - time) / SPAN_MS), y = height - height * (value - low) / (high - low);
        if (known && pen) g.lineTo(x, y); else g.moveTo(x, y);
        pen = !Number.isNaN(value);
      });
      g.stroke();
    });
    const newest = this.rows[this.rows.length - 1];
    this.value.textContent = newest === undefined ? "" : this.lines.map((line, i) =>
      `${line.name}${line.name ? " " : ""}${Number.isNaN(newest[i]) ? "–" : newest[i].toFixed(this.fromZero ? 2 : 3)}`).join("  ") + ` ${this.unit}`;
  }

  private axes(g: CanvasRenderingContext2D, width: number, height: number, low: number, high: number, line: string, ink: string): void {
    g.strokeStyle = line;
    g.fillStyle = ink;
    g.lineWidth = 1;
    g.font = "11px system-ui, sans-serif";
    for (const share of [0.25, 0.5, 0.75]) {
      const y = Math.round(height * (1 - share)) + 0.5;
      g.beginPath();
      g.moveTo(0, y);
      g.lineTo(width, y);
      g.stroke();
    }
    const digits = high - low < 0.1 ? 3 : high - low < 1 ? 2 : 1;
    g.fillText(high.toFixed(digits), 2, 11);
    g.fillText(low.toFixed(digits), 2, height - 3);
  }
}
