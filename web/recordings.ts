// SPDX-License-Identifier: Apache-2.0
// What is being recorded and what there is: start, stop, mark, play, fetch.

import { order } from "./api";
import { byId, make, setText, show } from "./dom";

const KINDS = ["viewing", "source", "poses"] as const;
type Kind = (typeof KINDS)[number];
const LABELS: Record<Kind, string> = { viewing: "Viewing", source: "Source", poses: "Poses" };
const LISTED = 20;
const PERIOD_MS = 2000;

interface KindState { kind: Kind; state: "off" | "recording" | "stopped"; name?: string; dropped: number; problem?: string }
interface Recording { name: string; kind: Kind; bytes: number; files: { name: string; bytes: number }[] }
interface Recordings { directory: string; bytes: number; problem?: string; kinds: KindState[]; recordings: Recording[] }

function size(bytes: number): string {
  return bytes < 1e6 ? `${(bytes / 1e3).toFixed(0)} kB` : bytes < 1e9 ? `${(bytes / 1e6).toFixed(1)} MB` : `${(bytes / 1e9).toFixed(2)} GB`;
}

const address = (recording: string, file: string) =>
  `api/v1/recordings/${encodeURIComponent(recording)}/${encodeURIComponent(file)}`;

export class RecordingPanel {
  private readonly buttons = new Map<Kind, HTMLButtonElement>();
  private readonly mark = make("button", "", "Mark");
  private readonly text = make("input");
  private readonly problem = make("p", "why");
  private readonly list = make("ul", "recordings");
  private readonly player = make("div", "player");
  private shown = "";

  constructor(private readonly tell: (text: string) => void) {
    const bar = make("div", "do");
    for (const kind of KINDS) {
      const button = make("button", "", LABELS[kind]);
      button.type = "button";
      button.dataset.kind = kind;
      button.setAttribute("aria-pressed", "false");
      button.addEventListener("click", () => void this.toggle(kind, button));
      this.buttons.set(kind, button);
      bar.append(button);
    }
    const marking = make("form", "do");
    this.text.setAttribute("aria-label", "Text of the mark");
    this.text.maxLength = 200;
    this.text.placeholder = "what happens now";
    this.mark.type = "submit";
    marking.append(this.text, this.mark);
    marking.addEventListener("submit", (event) => {
      event.preventDefault();
      void this.addMark();
    });
    this.problem.hidden = this.player.hidden = true;
    byId("recordings").append(bar, marking, this.problem, this.player, this.list);
  }

  start(): void {
    const turn = async () => {
      if (!document.hidden) await this.look();
      setTimeout(() => void turn(), PERIOD_MS);
    };
    void turn();
  }

  private async look(): Promise<void> {
    try {
      const answer = await fetch("api/v1/recordings");
      if (answer.ok) this.take(await answer.json() as Recordings);
    } catch {
      // The page says itself that the daemon does not answer.
    }
  }

  private take(state: Recordings): void {
    const possible = state.directory !== "";
    const problems = state.kinds.filter((kind) => kind.problem).map((kind) => `${LABELS[kind.kind]}: ${kind.problem}`);
    if (state.problem) problems.push(state.problem);
    if (!possible) problems.push("No folder takes recordings: [record] directory names it.");
    show(this.problem, problems.join("\n"));
    for (const kind of state.kinds) {
      const button = this.buttons.get(kind.kind);
      if (!button) continue;
      const on = kind.state !== "off";
      button.disabled = !possible;
      button.setAttribute("aria-pressed", String(on));
      setText(button, `${on ? "■ Stop" : "● Record"} ${LABELS[kind.kind].toLowerCase()}`);
      button.title = kind.dropped > 0 ? `${kind.dropped} dropped since the start` : "";
    }
    this.mark.disabled = this.text.disabled = !state.kinds.some((kind) => kind.state === "recording");
    const running = new Set(state.kinds.map((kind) => kind.name));
    const shown = JSON.stringify([state.recordings.slice(0, LISTED), [...running]]);
    if (shown === this.shown) return;
    this.shown = shown;
    this.list.replaceChildren(...state.recordings.slice(0, LISTED).map((one) => this.line(one, running.has(one.name))));
    if (state.recordings.length > LISTED) this.list.append(make("li", "", `and ${state.recordings.length - LISTED} older`));
  }

  private line(recording: Recording, running: boolean): HTMLElement {
    const line = make("li");
    line.append(make("span", "", `${recording.name} · ${size(recording.bytes)}${running ? " · recording" : ""}`));
    const files = make("div", "do");
    for (const file of recording.files) {
      if (file.name.endsWith(".mp4")) {
        const play = make("button", "", `▶ ${file.name.replace(/\.mp4$/, "")}`);
        play.type = "button";
        play.setAttribute("aria-label", `Play ${file.name} of ${recording.name}`);
        play.addEventListener("click", () => this.play(recording.name, file.name));
        files.append(play);
      }
      const link = make("a", "", file.name.endsWith(".mp4") ? "↓" : file.name);
      link.href = address(recording.name, file.name);
      link.download = `${recording.name}-${file.name}`;
      link.setAttribute("aria-label", `Download ${file.name} of ${recording.name}, ${size(file.bytes)}`);
      files.append(link);
    }
    line.append(files);
    return line;
  }

  private play(recording: string, file: string): void {
    const video = make("video");
    video.controls = video.autoplay = video.muted = true;
    video.setAttribute("aria-label", `${file} of ${recording}`);
    video.src = address(recording, file);
    video.addEventListener("error", () => this.tell(`${file} does not play: ${video.error?.message ?? ""}`));
    const close = make("button", "", "Close");
    close.type = "button";
    close.addEventListener("click", () => {
      video.removeAttribute("src");
      video.load();
      this.player.replaceChildren();
      this.player.hidden = true;
    });
    this.player.replaceChildren(video, close);
    this.player.hidden = false;
    this.player.scrollIntoView({ block: "nearest" });
    video.play().catch(() => undefined);  // what does not play is told above
  }

  private async toggle(kind: Kind, button: HTMLButtonElement): Promise<void> {
    const what = button.getAttribute("aria-pressed") === "true" ? "stop" : "start";
    const wrong = await order(`api/v1/recordings/${what}`, { kinds: [kind] });
    this.tell(wrong ? `recording ${kind}: ${what} refused: ${wrong}` : `recording ${kind}: ${what}`);
    await this.look();
  }

  private async addMark(): Promise<void> {
    const text = this.text.value;
    const wrong = await order("api/v1/recordings/mark", { text });
    this.tell(wrong ? `mark refused: ${wrong}` : `marked: ${text || "now"}`);
    if (!wrong) this.text.value = "";
  }
}
