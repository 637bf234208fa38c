// SPDX-License-Identifier: Apache-2.0
// The hosts that work together with this one: who is there, who keeps the estimates, whose page shows which camera.

import { Cell, CellHost, State } from "./api";
import { byId, make, setText, show } from "./dom";

const ROLES: Record<string, string> = { both: "cameras and estimates", cameras: "cameras", fusion: "estimates" };

/** Where a host's page shows one of its cameras large; null: nobody said where it is. */
function pageOf(host: CellHost, camera: string): string | null {
  try {
    const url = new URL(host.page ?? "");
    if (url.protocol !== "https:" && url.protocol !== "http:") return null;
    if (camera) url.searchParams.set("camera", camera);
    return url.href;
  } catch {
    return null;
  }
}

function link(href: string | null, text: string): HTMLElement {
  if (!href) return make("span", "", text);
  const made = make("a", "", text);
  made.href = href;
  made.rel = "noopener";
  return made;
}

export class CellPanel {
  private readonly facts = make("p", "facts");
  private readonly fault = make("p", "problem");
  private readonly hosts = make("ul", "places");
  private readonly neighbors = make("ul", "places");
  private shown = "";

  constructor() {
    this.fault.hidden = true;
    byId("cell").append(this.facts, this.fault, this.hosts, this.neighbors);
  }

  takeState(state: State): void {
    byId("cell").parentElement!.hidden = !state.cell;
    const now = JSON.stringify(state.cell ?? null);
    if (!state.cell || now === this.shown) return;
    this.shown = now;
    const cell = state.cell;
    setText(this.facts, `${cell.name} at ${cell.broker}; ${cell.fusion ? `${cell.fusion} keeps the estimates` : "nobody keeps the estimates"}`);
    show(this.fault, cell.connected ? cell.refused ? `Another host keeps the estimates already, so ${cell.host} does not.` : ""
      : `The broker is away${cell.problem ? `: ${cell.problem}` : ""}. What follows is from before.`);
    this.hosts.replaceChildren(...cell.hosts.map((host) => this.host(cell, host)));
    this.neighbors.replaceChildren(...(cell.neighbors ?? []).map((neighbor) => this.neighbor(cell, neighbor)));
  }

  private host(cell: Cell, host: CellHost): HTMLElement {
    const line = make("li"), own = host.host === cell.host;
    const name = link(own ? null : pageOf(host, ""), host.host);
    if (!own && name instanceof HTMLAnchorElement) name.setAttribute("aria-label", `Page of host ${host.host}`);
    const chip = host.online ? host.clock_fit ? make("span", "chip good", "✓ here") : make("span", "chip weak", "! clock not fit")
      : make("span", "chip bad", "× away");
    line.append(name, chip, make("span", "facts", `${own ? "this host, " : ""}${ROLES[host.role] ?? host.role}` +
      `, clock to ${(1e3 * host.clock_bound_s).toFixed(2)} ms${host.clock_fit ? "" : `: ${host.clock}`}`));
    if (host.cameras.length > 0) line.append(this.cameras(host, own));
    return line;
  }

  private cameras(host: CellHost, own: boolean): HTMLElement {
    const list = make("span", "cameras-of");
    list.append("cameras: ");
    host.cameras.forEach((camera, i) => {
      if (i > 0) list.append(", ");
      const shown = link(own || !host.online ? null : pageOf(host, camera), camera);
      if (shown instanceof HTMLAnchorElement) shown.setAttribute("aria-label", `Camera ${camera} on the page of host ${host.host}`);
      list.append(shown);
      if (host.cameras_away?.includes(camera)) list.append(make("span", "chip bad", "× no frames"));
    });
    return list;
  }

  private neighbor(cell: Cell, neighbor: { cell: string; fusion: string }): HTMLElement {
    const line = make("li");
    const held = (cell.objects ?? []).filter((object) => object.cell === neighbor.cell).map((object) => object.name);
    line.append(make("span", "", `next: ${neighbor.cell}`),
      neighbor.fusion ? make("span", "chip good", "✓ here") : make("span", "chip weak", "! nobody keeps its estimates"),
      make("span", "facts", (neighbor.fusion ? `${neighbor.fusion} keeps its estimates` : "") + (held.length ? `; has ${held.join(", ")}` : "")));
    return line;
  }
}
