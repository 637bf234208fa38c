// SPDX-License-Identifier: Apache-2.0
// How objects are drawn: theme and marks, for all cameras or one, in force at once and written to no file.

import { fetchJson, order, State } from "./api";
import { byId, make, setText } from "./dom";

type Value = boolean | number | string | string[];
interface Look { name: string; virtual: boolean; as_in_file: boolean; overlay: Record<string, Value> }
interface Overlay { themes: string[]; styles: string[]; cameras: Look[] }

const ALL = "";
const SWITCHES: Record<string, string> = { last_seen: "last seen", status: "status line", hidden_lines: "hidden lines" };
const words = (name: string) => name.replace(/_/g, " ");

export class OverlayPanel {
  private readonly camera = make("select");
  private readonly theme = make("select");
  private readonly fill = make("select");
  private readonly marks = make("fieldset", "marks");
  private readonly reset = make("button", "", "As in the file");
  private readonly note = make("p", "facts");
  private overlay: Overlay | null = null;
  private asked = "";

  constructor(private readonly tell: (text: string) => void) {
    const bar = make("div", "do");
    const labelled = (text: string, select: HTMLSelectElement) => {
      const label = make("label", "", text + " ");
      label.append(select);
      bar.append(label);
    };
    labelled("Of", this.camera);
    labelled("Theme", this.theme);
    labelled("Fill", this.fill);
    for (const name of ["none", "shaded", "textured"]) this.fill.append(new Option(name, name));
    this.camera.addEventListener("change", () => this.show());
    this.theme.addEventListener("change", () => this.theme.value && void this.set({ theme: this.theme.value }));
    this.fill.addEventListener("change", () => void this.setFill());
    this.reset.type = "button";
    this.reset.addEventListener("click", () => void this.put("DELETE", "as in the file", undefined));
    const end = make("div", "do");
    end.append(this.reset);
    this.note.setAttribute("role", "status");
    byId("overlay").append(bar, this.marks, end, this.note);
  }

  /** Asks anew when another file is in force, and now and then: others may change it, too. */
  takeState(state: State): void {
    const now = `${state.config.loaded} ${Math.floor(Date.now() / 5000)}`;
    if (now === this.asked || document.hidden) return;
    this.asked = now;
    void fetchJson<Overlay>("api/v1/overlay").then((overlay) => overlay && this.take(overlay));
  }

  private take(overlay: Overlay): void {
    if (JSON.stringify(overlay) === JSON.stringify(this.overlay)) return;
    const before = this.overlay;
    this.overlay = overlay;
    const names = overlay.cameras.map((camera) => camera.name);
    if (before?.cameras.map((camera) => camera.name).join("\n") !== names.join("\n")) {
      const chosen = this.camera.value;
      this.camera.replaceChildren(new Option("all cameras", ALL), ...names.map((name) => new Option(name, name)));
      this.camera.value = names.includes(chosen) ? chosen : ALL;
      this.theme.replaceChildren(new Option("choose…", ""), ...overlay.themes.map((name) => new Option(words(name), name)));
    }
    this.show();
  }

  private looks(): Look[] {
    const one = this.camera.value;
    return (this.overlay?.cameras ?? []).filter((camera) => one === ALL || camera.name === one);
  }

  private show(): void {
    const looks = this.looks(), overlay = this.overlay;
    if (!overlay || looks.length === 0) return;
    const has = (look: Look, name: string) =>
      name in SWITCHES ? look.overlay[name] === true : (look.overlay.styles as string[]).includes(name);
    const names = [...overlay.styles.filter((name) => name !== "fill"), ...Object.keys(SWITCHES)];
    if (this.marks.childElementCount !== names.length + 1) {
      this.marks.replaceChildren(make("legend", "", "Marks"), ...names.map((name) => this.mark(name)));
    }
    for (const box of this.marks.querySelectorAll("input")) {
      const count = looks.filter((look) => has(look, box.name)).length;
      box.checked = count === looks.length;
      box.indeterminate = count > 0 && count < looks.length;
    }
    const first = looks[0];
    this.fill.value = has(first, "fill") ? String(first.overlay.fill) : "none";
    this.theme.value = "";
    const changed = overlay.cameras.filter((camera) => !camera.as_in_file).map((camera) => camera.name);
    this.reset.disabled = changed.length === 0;
    setText(this.note, changed.length > 0 ? `Not as in the file: ${changed.join(", ")}. A restart forgets it.` : "");
    this.note.hidden = changed.length === 0;
  }

  private mark(name: string): HTMLElement {
    const label = make("label"), box = make("input");
    box.type = "checkbox";
    box.name = name;
    box.addEventListener("change", () => void this.setMark(name, box.checked));
    label.append(box, make("span", "", SWITCHES[name] ?? words(name)));
    return label;
  }

  private async setMark(name: string, on: boolean): Promise<void> {
    if (name in SWITCHES) return this.set({ [name]: on });
    await this.setStyles((styles) => on ? [...new Set([...styles, name])] : styles.filter((one) => one !== name));
  }

  private async setFill(): Promise<void> {
    const fill = this.fill.value;
    await this.setStyles((styles) => fill === "none" ? styles.filter((one) => one !== "fill") : [...new Set([...styles, "fill"])],
      fill === "none" ? {} : { fill });
  }

  /** Each camera keeps what else it shows. */
  private async setStyles(change: (styles: string[]) => string[], more: Record<string, Value> = {}): Promise<void> {
    const groups = new Map<string, string[]>();
    for (const look of this.looks()) {
      const styles = change(look.overlay.styles as string[]), key = styles.join(" ");
      groups.set(key, [...(groups.get(key) ?? []), look.name]);
    }
    const all = this.camera.value === ALL && groups.size === 1;
    for (const [key, names] of groups) {
      const styles = key === "" ? [] : key.split(" ");
      for (const camera of all ? [ALL] : names) await this.set({ styles, ...more }, camera);
    }
  }

  private async set(keys: Record<string, Value>, camera = this.camera.value): Promise<void> {
    await this.put("PUT", Object.entries(keys).map(([key, value]) => `${words(key)} ${String(value)}`).join(", "),
      { ...(camera === ALL ? {} : { camera }), ...keys });
  }

  private async put(method: "PUT" | "DELETE", what: string, body: unknown): Promise<void> {
    const wrong = await order("api/v1/overlay", body, method);
    this.tell(wrong ? `overlay refused: ${wrong}` : `overlay: ${what}`);
    const overlay = await fetchJson<Overlay>("api/v1/overlay");
    if (overlay) {
      this.overlay = null;
      this.take(overlay);
    }
  }
}
