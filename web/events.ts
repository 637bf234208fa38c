// SPDX-License-Identifier: Apache-2.0
// What happened, newest first: the daemon's own messages, also those from before this page was opened, and what this page
// has to tell.

import { fetchJson } from "./api";
import { byId, make } from "./dom";

const MOST = 200;
const PERIOD_MS = 2000;

interface LogEvent { number: number; utc_ns: number; level: "info" | "warning" | "error"; text: string }

export class EventList {
  private readonly list = byId("events");
  private after = 0;
  private asking = false;

  start(): void {
    setInterval(() => void this.look(), PERIOD_MS);
  }

  /** Something that only this page knows. */
  tell(text: string): void {
    this.insert(Date.now(), text, "");
  }

  /** Another daemon may answer now: it counts from the beginning. */
  connected(): void {
    this.after = 0;
    for (const line of this.list.querySelectorAll("[data-number]")) line.remove();
    void this.look();
  }

  private async look(): Promise<void> {
    if (document.hidden || this.asking) return;
    this.asking = true;
    const log = await fetchJson<{ events: LogEvent[] }>(`api/v1/log?after=${this.after}`);
    this.asking = false;
    for (const event of log?.events ?? []) {
      if (event.number <= this.after) continue;
      this.after = event.number;
      // That an order was given is told by who gave it; what came of it has a message of its own.
      if (!event.text.startsWith("http: ")) this.insert(event.utc_ns / 1e6, event.text, event.level).dataset.number = String(event.number);
    }
  }

  private insert(time: number, text: string, level: string): HTMLElement {
    const line = make("li", level), date = new Date(time);
    line.dataset.time = String(time);
    const today = date.toDateString() === new Date().toDateString();
    const clock = date.toLocaleTimeString("en-GB");
    const stamp = make("time", "", today ? clock : `${date.getDate()} ${date.toLocaleString("en-GB", { month: "short" })} ${clock}`);
    stamp.dateTime = date.toISOString();
    const words = make("span", "", text);
    if (level === "warning" || level === "error") words.prepend(make("strong", "", `${level} `));
    line.append(stamp, words);
    let next = this.list.firstElementChild as HTMLElement | null;
    while (next && Number(next.dataset.time) > time) next = next.nextElementSibling as HTMLElement | null;
    this.list.insertBefore(line, next);
    while (this.list.childElementCount > MOST) this.list.lastElementChild?.remove();
    return line;
  }
}
