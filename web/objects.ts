// SPDX-License-Identifier: Apache-2.0
// One card for each object: its state with the reasons, where it is and how well that is known, and what can be done.

import { Pose, SeenObject, TrackState } from "./api";
import { make, setText, show } from "./dom";

const WORDS: Record<TrackState, string> = {
  searching: "? searching", tracking: "✓ tracking", degraded: "! degraded", coasting: "… coasting", lost: "× lost",
};
const LOOKS: Record<TrackState, string> = {
  searching: "", tracking: "good", degraded: "weak", coasting: "coast", lost: "bad",
};
const REASONS: Record<string, string> = {
  unconfirmed: "too few measurements have agreed yet", several_poses: "the pictures fit more than one pose",
  ambiguous: "it looks alike in other poses", weak_position: "its position is weak in one direction",
  weak_rotation: "its turn about one axis is weak", one_camera: "one camera alone sees it",
  contradicted: "cameras contradict it", unexplained: "the pictures show more of it, or less",
  possible_swap: "it may be another one that looks alike",
  flat_print: "one camera alone sees one flat side, at rest: it may be a picture",
};

const LATELY_MS = 500;

export interface ObjectOwner {
  point(object: string): void;
  forget(object: string): void;
}

export class ObjectCard {
  readonly element = make("article", "object");
  state: TrackState = "searching";
  private quiet = false;
  private readonly lately: { time: number; pose: Pose }[] = [];
  private readonly chip = make("span", "chip");
  private readonly why = make("p", "why");
  private readonly facts = make("dl");
  private readonly look = make("button", "", "Say where it is");
  private readonly values = new Map<string, HTMLElement>();

  constructor(readonly name: string, owner: ObjectOwner) {
    this.element.setAttribute("aria-label", `Object ${name}`);
    this.element.dataset.object = name;
    const head = make("div", "head");
    head.append(make("h3", "", name), this.chip);
    for (const label of ["Position", "Uncertainty", "Cameras", "In view", "Points"]) {
      const value = make("dd");
      this.values.set(label, value);
      this.facts.append(make("dt", "", label), value);
    }
    const buttons = make("div", "do");
    const forget = make("button", "", "Forget");
    forget.type = this.look.type = "button";
    forget.setAttribute("aria-label", `Forget where ${name} is`);
    this.look.setAttribute("aria-label", `Say where it is: ${name}, in a picture`);
    this.look.setAttribute("aria-pressed", "false");
    this.look.addEventListener("click", () => owner.point(name));
    forget.addEventListener("click", () => owner.forget(name));
    buttons.append(this.look, forget);
    this.why.hidden = true;
    this.element.append(head, this.why, this.facts, buttons);
  }

  /** The daemon says nothing any more: what it said last is no news of where the object is. */
  set silent(on: boolean) {
    if (on === this.quiet) return;
    this.quiet = on;
    if (on) {
      setText(this.chip, "? not known");
      this.chip.className = "chip";
      show(this.why, "the daemon is silent; what follows is the last that it said");
    } else if (this.lately.length > 0) {
      this.say(this.lately[this.lately.length - 1].pose);
    }
  }
  get silent(): boolean { return this.quiet; }

  set pointing(on: boolean) { this.look.setAttribute("aria-pressed", String(on)); }

  /** A pose, at any rate. */
  take(pose: Pose): void {
    const now = performance.now();
    this.lately.push({ time: now, pose });
    while (this.lately[0].time < now - LATELY_MS) this.lately.shift();
    this.say(this.usual());
  }

  /** The state that most poses of the last half second had: single frames come and go. */
  private usual(): Pose {
    const count = (state: TrackState) => this.lately.filter(({ pose }) => pose.state === state).length;
    return this.lately.reduce((best, entry) =>
      count(entry.pose.state) >= count(best.pose.state) ? entry : best).pose;
  }

  private say(pose: Pose): void {
    this.state = pose.state;
    setText(this.chip, WORDS[pose.state]);
    this.chip.className = `chip ${LOOKS[pose.state]}`;
    show(this.why, (pose.reasons ?? []).map((reason) => REASONS[reason] ?? reason).join("; "));
    const at = pose.translation_m;
    this.set("Position", at ? at.map((value) => value.toFixed(3)).join("  ") + " m" : "–");
    const known = pose.sigma_t_mm !== undefined && pose.sigma_r_deg !== undefined;
    this.set("Uncertainty", known ? `${pose.sigma_t_mm?.toFixed(2)} mm, ${pose.sigma_r_deg?.toFixed(2)}°` : "–");
    this.set("Cameras", pose.cameras?.length ? pose.cameras.join(", ") : "–");
  }

  /** What only the state says. */
  takeState(object: SeenObject): void {
    const points = object.points;
    this.set("Points", points ? `${points.rms_mm.toFixed(1)} mm rms${points.contradicts ? ", contradict the pose" : ""}` : "–");
    const sight = (object.sight ?? []).map(({ camera, sees, changes_in_s: later }) => later === undefined ? camera
      : `${camera} (${sees ? "until" : "from"} ${later.toFixed(1)} s)`);
    this.set("In view", sight.length > 0 ? sight.join(", ") : "–");
  }

  private set(label: string, text: string): void {
    const value = this.values.get(label);
    if (value) setText(value, text);
  }
}
