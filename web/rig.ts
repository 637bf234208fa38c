// SPDX-License-Identifier: Apache-2.0
// What the rig stands on: the calibration in force, camera by camera, with what is proposed to be taken over; and the
// installation file with its errors.

import { fetchJson, order, State } from "./api";
import { byId, make, setText, show } from "./dom";

interface CameraPlace { name: string; rms_px: number; calibration?: { state: string; compared_s: number; vote: number; turned_deg?: number; shifted_mm?: number } }
interface Calibration { file: string; content: string; watched: boolean; report: boolean; proposal?: string; cameras: CameraPlace[] }

const LOOKS: Record<string, string> = { in_order: "good", knocked: "bad", drifting: "weak", disputed: "weak", unfit: "bad" };
const WORDS: Record<string, string> =
  { unknown: "? not compared yet", in_order: "✓ in order", knocked: "× knocked", drifting: "! drifting", disputed: "! disputed",
    unfit: "× wrong picture" };

export class RigPanel {
  private readonly cameras = make("ul", "places");
  private readonly inForce = make("p", "facts");
  private readonly report = make("a", "", "Report");
  private readonly links = make("div", "do");
  private readonly file = make("p", "facts");
  private readonly fault = make("p", "problem");
  private asked = "";

  constructor(private readonly tell: (text: string) => void) {
    this.report.href = "api/v1/calibration/report";
    this.report.target = "_blank";
    this.report.rel = "noopener";
    this.links.hidden = true;
    this.links.append(this.report);
    byId("calibration").append(this.cameras, this.inForce, this.links);
    const reload = make("button", "", "Read it again");
    reload.type = "button";
    reload.addEventListener("click", () => void this.reload());
    const bar = make("div", "do");
    bar.append(reload);
    this.fault.hidden = true;
    byId("configuration").append(this.file, this.fault, bar);
  }

  takeState(state: State): void {
    const { file, loaded, content, refused } = state.config;
    setText(this.file, `${file}, read ${loaded.replace("T", " ").replace("Z", " UTC")}, content ${content}`);
    show(this.fault, refused ? `Refused ${refused.at.replace("T", " ")}:\n${refused.problem}` : "");
    const now = `${loaded} ${state.cameras.map((camera) => camera.calibration?.state).join()} ${Math.floor(Date.now() / 5000)}`;
    if (now === this.asked || document.hidden) return;
    this.asked = now;
    void this.look();
  }

  private async look(): Promise<void> {
    const calibration = await fetchJson<Calibration>("api/v1/calibration");
    if (!calibration) return;
    setText(this.inForce, `${calibration.file}, epoch ${calibration.content}${calibration.watched ? "" : ", not watched over"}`);
    this.cameras.replaceChildren(...calibration.cameras.map((camera) => this.line(camera, calibration.proposal !== undefined)));
    this.links.hidden = !calibration.report;
  }

  private line(camera: CameraPlace, proposed: boolean): HTMLElement {
    const line = make("li"), place = camera.calibration, state = place?.state ?? "unknown";
    line.append(make("span", "", `${camera.name}, ${camera.rms_px.toFixed(2)} px`),
      make("span", `chip ${LOOKS[state] ?? ""}`, place ? WORDS[state] ?? state : "not watched"));
    if (place?.turned_deg === undefined || place.shifted_mm === undefined) return line;
    line.append(make("span", "facts", `turned ${place.turned_deg.toFixed(2)}°, shifted ${place.shifted_mm.toFixed(1)} mm, ` +
      `${Math.round(100 * place.vote)} % of its vote`));
    if (!proposed) return line;
    const accept = make("button", "", "Accept new place");
    accept.type = "button";
    accept.setAttribute("aria-label", `Accept the new place of camera ${camera.name}`);
    accept.addEventListener("click", () => void this.accept(camera.name));
    line.append(accept);
    return line;
  }

  private async accept(camera: string): Promise<void> {
    const wrong = await order("api/v1/calibration/accept", { cameras: [camera] });
    this.tell(wrong ? `new place of ${camera} refused: ${wrong}` : `new place of ${camera} accepted`);
    this.asked = "";
  }

  private async reload(): Promise<void> {
    const wrong = await order("api/v1/reload", {});
    this.tell(wrong ? `reload refused: ${wrong}` : "the installation file is being read");
  }
}
