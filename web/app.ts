// SPDX-License-Identifier: Apache-2.0
// The page: follows the daemon's events and pictures, and lets an operator say where to look.

import { Camera, follow, order, PoseEvent, SeenObject, State, VirtualCamera } from "./api";
import { CapturePanel } from "./capture";
import { CellPanel } from "./cell";
import { byId, setText, show } from "./dom";
import { EventList } from "./events";
import { ObjectCard } from "./objects";
import { OverlayPanel } from "./overlay";
import { PictureFeed } from "./pictures";
import { Plot } from "./plot";
import { RecordingPanel } from "./recordings";
import { RigPanel } from "./rig";
import { ScenePanel } from "./scene";
import { Tile } from "./tiles";
import { canPlayVideo, VideoFeed } from "./whep";

const SILENT_MS = 3000;  // the state comes every second
const THEMES = ["automatic", "light", "dark"] as const;

class Page {
  private state: State | null = null;
  private linked = false;
  private heard = 0;  // [ms] when the daemon last said its state
  private readonly tiles = new Map<string, Tile>();
  private readonly objects = new Map<string, ObjectCard>();
  private readonly plots = new Map<string, { accuracy: Plot; place: Plot }>();
  private readonly held = new Map<string, PoseEvent>();  // the newest of each object
  private readonly told = new Map<string, string>();  // what the events said last, by whom
  private readonly pictures = new PictureFeed((picture) => this.tiles.get(picture.camera)?.take(picture));
  private readonly videos = new VideoFeed((camera) => this.tiles.get(camera)?.video ?? null,
    (camera, age) => this.tiles.get(camera)?.takeFrame(age), (cameras) => this.fetchPictures(cameras));
  private readonly scene = new ScenePanel();
  private readonly events = new EventList();
  private readonly overlay = new OverlayPanel((text) => this.tell(text));
  private readonly rig = new RigPanel((text) => this.tell(text));
  private readonly cell = new CellPanel();
  private readonly capture = new CapturePanel((text) => this.tell(text), (camera) => this.tiles.get(camera)?.frame ?? null);
  private fetched = "";
  private readonly since = new Map<string, { state: string; time: number }>();
  private wanted = new URLSearchParams(location.search).get("camera") ?? "";  // enlarged once it is there: another host's page says which
  private one = "";         // the camera that is enlarged
  private pointing = "";    // the object that is pointed at
  private clock = Infinity; // [ms] this machine's clock before the daemon's, with the shortest way so far
  private watched = "";
  private readonly videoChosen = new URLSearchParams(location.search).get("video") !== "off";

  start(): void {
    follow({
      state: (state) => this.takeState(state),
      pose: (pose) => this.takePose(pose),
      missed: (poses) => this.tell(`this page was too slow for ${poses} poses`),
      link: (up) => this.setLink(up),
    });
    byId("all").addEventListener("click", () => this.enlarge(""));
    document.addEventListener("keydown", (event) => {
      if (event.key !== "Escape") return;
      if (this.pointing) this.point(""); else this.enlarge("");
    });
    document.addEventListener("visibilitychange", () => this.watch());
    setInterval(() => this.refresh(), 250);
    this.startTheme();
    this.scene.start();
    this.events.start();
    this.capture.watch();
    new RecordingPanel((text) => this.tell(text)).start();
  }

  private setLink(up: boolean): void {
    if (up !== this.linked) this.tell(up ? "connected to the daemon" : "connection to the daemon lost");
    if (up) this.events.connected();
    this.linked = up;
    this.heard = Date.now();
    setText(byId("link"), up ? "connected" : "not connected");
    byId("link").className = "chip " + (up ? "good" : "bad");
  }

  private takeState(state: State): void {
    this.state = state;
    this.heard = Date.now();
    this.clock = Math.min(this.clock + 0.1, Date.now() - state.utc_ns / 1e6);
    setText(byId("name"), state.name || "Sightline");
    document.title = `${state.name || "Sightline"} – Sightline`;
    const refused = state.config.refused;
    show(byId("banner"), refused ? `The newest configuration was refused; that of ${state.config.loaded} stays in force.\n${refused.problem}` : "");
    this.syncTiles([...state.cameras.filter((camera) => camera.streams), ...state.virtual_cameras]);
    this.syncObjects(state.objects);
    setText(byId("summary"), this.summary(state));
    this.scene.takeState(state);
    this.overlay.takeState(state);
    this.rig.takeState(state);
    this.cell.takeState(state);
    this.refresh();
  }

  private summary(state: State): string {
    const present = state.cameras.filter((camera) => camera.present).length;
    const parts = [`${present} of ${state.cameras.length} cameras`];
    if (state.recording) parts.push(state.recording.problem ? `recording stopped: ${state.recording.problem}` : "recording");
    for (const wait of state.waiting ?? []) parts.push(`${wait.thread} waits for ${wait.for}`);
    return parts.join(" · ");
  }

  /** Of estimates at one capture time the last one counts: the others have not heard all cameras. */
  private takePose(pose: PoseEvent): void {
    const before = this.held.get(pose.object);
    this.held.set(pose.object, pose);
    if (before && before.t_ns !== pose.t_ns) this.takeWhole(before);
  }

  private takeWhole(pose: PoseEvent): void {
    const card = this.objects.get(pose.object);
    this.scene.takePose(pose);
    if (!card) return;
    card.take(pose);
    const plots = this.plots.get(pose.object);
    plots?.accuracy.add([pose.sigma_t_mm ?? null]);
    plots?.place.add(pose.translation_m ?? [null, null, null]);
  }

  private syncTiles(cameras: (Camera | VirtualCamera)[]): void {
    const names = cameras.map((camera) => camera.name);
    for (const [name, tile] of this.tiles) {
      if (names.includes(name)) continue;
      tile.element.remove();
      this.tiles.delete(name);
    }
    for (const camera of cameras) {
      if (this.tiles.has(camera.name)) continue;
      const tile = new Tile(camera.name, camera.width, camera.height, {
        enlarge: (name) => this.enlarge(this.one === name ? "" : name),
        point: (name, x, y) => void this.hint(name, x, y),
        toLocal: (utcNs) => utcNs / 1e6 + this.clock,
      });
      this.tiles.set(camera.name, tile);
      byId("tiles").append(tile.element);
    }
    if (this.one && !names.includes(this.one)) this.one = "";
    if (names.includes(this.wanted)) {
      this.enlarge(this.wanted);
      this.wanted = "";
    }
    this.watch();
  }

  private syncObjects(objects: SeenObject[]): void {
    for (const [name, card] of this.objects) {
      if (objects.some((object) => object.name === name)) continue;
      card.element.remove();
      this.plots.get(name)?.accuracy.element.remove();
      this.plots.get(name)?.place.element.remove();
      this.objects.delete(name);
      this.plots.delete(name);
    }
    for (const object of objects) {
      const card = this.objects.get(object.name) ?? this.addObject(object.name);
      if (!this.held.has(object.name) || object.translation_m === undefined) card.take(object);
      card.takeState(object);
    }
    if (objects.length === 0) setText(byId("objects"), "none in this installation");
  }

  private addObject(name: string): ObjectCard {
    const card = new ObjectCard(name, {
      point: (object) => this.point(this.pointing === object ? "" : object),
      forget: (object) => void this.forget(object),
    });
    this.objects.set(name, card);
    byId("objects").append(card.element);
    const accuracy = new Plot(`${name}: uncertainty of position`, "mm", [{ name: "", dash: [], color: "--accent" }], true);
    const place = new Plot(`${name}: position`, "m", [{ name: "x", dash: [], color: "--bad" },
      { name: "y", dash: [5, 3], color: "--good" }, { name: "z", dash: [1.5, 2.5], color: "--coast" }], false);
    this.plots.set(name, { accuracy, place });
    byId("plots").append(accuracy.element, place.element);
    return card;
  }

  private enlarge(name: string): void {
    this.one = name;
    for (const [tileName, tile] of this.tiles) {
      tile.element.hidden = name !== "" && tileName !== name;
      tile.enlarged = tileName === name;
    }
    byId("tiles").classList.toggle("one", name !== "");
    byId("all").hidden = name === "";
    this.watch();
  }

  /** Pictures of what can be seen, and of nothing while the page is hidden. */
  private watch(): void {
    const names = document.hidden ? [] : this.one ? [this.one] : [...this.tiles.keys()];
    const byVideo = this.state?.webrtc === true && this.videoChosen && canPlayVideo();
    const wanted = names.join("\n") + byVideo;
    if (wanted === this.watched) return;
    this.watched = wanted;
    this.videos.watch(byVideo ? names : []);
    if (!byVideo) this.fetchPictures(names);
  }

  /** Of cameras whose video is not to be had. */
  private fetchPictures(names: string[]): void {
    if (names.join("\n") === this.fetched) return;
    this.fetched = names.join("\n");
    this.pictures.watch(names);
  }

  private point(object: string): void {
    this.pointing = object;
    show(byId("pointing"), object ? `Click on ${object} in a picture, or steer with the arrow keys there and press Enter. Escape ends.` : "");
    for (const [name, card] of this.objects) card.pointing = name === object;
    for (const tile of this.tiles.values()) tile.pointing = object !== "";
  }

  private async hint(camera: string, x: number, y: number): Promise<void> {
    const object = this.pointing;
    if (!object) return;
    this.tiles.get(camera)?.mark(x, y);
    const wrong = await order(`api/v1/objects/${encodeURIComponent(object)}/hint`, { camera, x, y });
    this.tell(wrong ? `hint for ${object} refused: ${wrong}` : `${object} is looked for at ${x.toFixed(0)}, ${y.toFixed(0)} in ${camera}`);
    if (!wrong) setTimeout(() => this.point(""), 800);
  }

  private async forget(object: string): Promise<void> {
    const wrong = await order(`api/v1/objects/${encodeURIComponent(object)}/forget`, {});
    this.tell(wrong ? `forget ${object} refused: ${wrong}` : `${object} forgotten: it is searched for anew`);
  }

  private tellChange(whom: string, what: string, text: string): void {
    const before = this.told.get(whom);
    if (before === what) return;
    this.told.set(whom, what);
    this.tell(text);
  }

  /** A state that has stayed for a second is an event. */
  private tellLasting(card: ObjectCard): void {
    const now = performance.now(), known = this.since.get(card.name);
    if (known?.state !== card.state) this.since.set(card.name, { state: card.state, time: now });
    else if (now - known.time > 1000) this.tellChange(`object ${card.name}`, card.state, `${card.name}: ${card.state}`);
  }

  private tell(text: string): void {
    this.events.tell(text);
  }

  private refresh(): void {
    // A daemon that hangs keeps its connection: silence is what tells.
    const silent = this.linked && Date.now() - this.heard > SILENT_MS;
    const link = byId("link");
    if (silent) {
      setText(link, `silent for ${((Date.now() - this.heard) / 1000).toFixed(0)} s`);
      link.className = "chip bad";
    } else if (this.linked) {
      setText(link, "connected");
      link.className = "chip good";
    }
    for (const card of this.objects.values()) card.silent = silent || !this.linked;
    const cameras = this.state ? [...this.state.cameras, ...this.state.virtual_cameras] : [];
    for (const card of this.objects.values()) if (!card.silent) this.tellLasting(card);
    for (const camera of cameras) this.tiles.get(camera.name)?.update(camera, this.linked && !silent);
    for (const { accuracy, place } of this.plots.values()) {
      accuracy.draw();
      place.draw();
    }
  }

  private startTheme(): void {
    const button = byId("theme"), dark = matchMedia("(prefers-color-scheme: dark)");
    const parameter = new URLSearchParams(location.search).get("theme");
    let theme = THEMES.find((name) => name === (parameter ?? localStorage.getItem("theme"))) ?? "automatic";
    const apply = () => {
      const isDark = theme === "dark" || (theme === "automatic" && dark.matches);
      document.documentElement.dataset.theme = isDark ? "dark" : "light";
      setText(button, `Theme: ${theme}`);
      this.scene.themed();
    };
    button.addEventListener("click", () => {
      theme = THEMES[(THEMES.indexOf(theme) + 1) % THEMES.length];
      localStorage.setItem("theme", theme);
      apply();
    });
    dark.addEventListener("change", apply);
    apply();
  }
}

new Page().start();
