// SPDX-License-Identifier: Apache-2.0
// What the daemon says (/api/v1/openapi.json), and how it is asked.

export type TrackState = "searching" | "tracking" | "degraded" | "coasting" | "lost";

export interface Camera {
  name: string; width: number; height: number; observes: boolean; streams: boolean; present: boolean;
  frames_lost: number; not_observed: number; not_drawn: number; rate_hz: number; capture_latency_s: number;
  viewers: number; webrtc_viewers: number; picture_viewers: number; no_signal_since?: string; problem?: string;
  calibration?: { state: string; vote: number; turned_deg?: number; shifted_mm?: number };
}
export interface VirtualCamera { name: string; width: number; height: number; viewers: number; webrtc_viewers: number; picture_viewers: number }
export interface Pose {
  state: TrackState; t_ns?: number; utc_ns?: number; translation_m?: [number, number, number];
  rotation_wxyz?: [number, number, number, number]; sigma_t_mm?: number; sigma_r_deg?: number; reasons?: string[]; cameras?: string[];
}
export interface Sight { camera: string; sees: boolean; share: number; changes_in_s?: number }
export interface SeenObject extends Pose { name: string; points?: { rms_mm: number; contradicts: boolean }; zones?: string[]; sight?: Sight[] }
export interface PoseEvent extends Pose { object: string; covariance?: number[] }
export interface CellHost {
  host: string; role: string; online: boolean; clock_fit: boolean; clock_bound_s: number; clock: string; page?: string;
  cameras: string[]; cameras_away?: string[];
}
export interface Cell {
  name: string; host: string; broker: string; connected: boolean; problem?: string; fusion: string; refused: boolean; hosts: CellHost[];
  neighbors?: { cell: string; fusion: string }[]; objects?: { name: string; cell: string }[];
}
export interface State {
  name: string; utc_ns: number; webrtc: boolean; config: { file: string; content: string; loaded: string; refused?: { at: string; problem: string } };
  recording?: { state: string; folder?: string; problem?: string };
  waiting?: { thread: string; for: string; since: string }[];
  cell?: Cell; cameras: Camera[]; virtual_cameras: VirtualCamera[]; objects: SeenObject[];
}

/** What is there, or null. */
export async function fetchJson<T>(path: string): Promise<T | null> {
  try {
    const answer = await fetch(path);
    return answer.ok ? await answer.json() as T : null;
  } catch {
    return null;  // the page says itself that the daemon does not answer
  }
}

/** Gives an order; returns what is wrong, or null. */
export async function order(path: string, body: unknown, method = "POST"): Promise<string | null> {
  try {
    const answer = await fetch(path, body === undefined ? { method } : {
      method, headers: { "Content-Type": "application/json" }, body: JSON.stringify(body),
    });
    if (answer.ok) return null;
    const said = await answer.json() as { error?: string };
    return said.error ?? `refused (${answer.status})`;
  } catch {
    return "the daemon does not answer";
  }
}

export interface Listener {
  state(state: State): void;
  pose(pose: PoseEvent): void;
  missed(poses: number): void;
  link(up: boolean): void;
}

/** Follows the event stream for ever; the browser connects again by itself. */
export function follow(listener: Listener): void {
  const source = new EventSource("api/v1/events?state=1");
  source.addEventListener("open", () => listener.link(true));
  source.addEventListener("error", () => {
    listener.link(false);
    if (source.readyState !== EventSource.CLOSED) return;
    source.close();  // it was refused: not tried again unless we do
    setTimeout(() => follow(listener), 2000);
  });
  const on = <T>(name: string, take: (data: T) => void) =>
    source.addEventListener(name, (event) => take(JSON.parse((event as MessageEvent<string>).data) as T));
  on<State>("state", (state) => listener.state(state));
  on<PoseEvent>("pose", (pose) => listener.pose(pose));
  on<{ poses: number }>("missed", (missed) => listener.missed(missed.poses));
}
