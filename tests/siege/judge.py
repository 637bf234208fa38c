# SPDX-License-Identifier: Apache-2.0
"""The criteria of a siege: each is one line with what was measured and what is allowed."""
import statistics

PERIOD_MS = 1000 / 30
GAP_MS = PERIOD_MS + 100       # between two frames of the good viewer
RSS_MB = 700                   # at any time
RSS_GROWTH_MB = 40             # last quarter of the siege against the second one
LOG_AVERAGE, LOG_BURST = 10, 40  # lines a second: of the whole siege, and in any one second
WATCHDOG_S = 2                 # between two signs of life (it says one each half second)
SETTLED = 8                    # descriptors and threads above those before the first attack, when all attackers have left
STOP_S = 2
NEWCOMERS = 0.9                # share of new viewers that get to watch: there are places, if the idle ones give way
LATE = 10                      # a busy machine alone may make a time so many times longer, and no more
BUSY_SHARE = 0.25              # and such a share of frames or polls go amiss


class Verdict:
    def __init__(self):
        self.criteria = []

    def check(self, name, measured, ok, allowed, times=False):
        """`times`: a busy machine alone can have made this fail, as far as it did."""
        self.criteria.append({"criterion": name, "ok": bool(ok), "measured": measured, "allowed": allowed, "times": times})

    def passed(self):
        return all(c["ok"] for c in self.criteria)

    def passed_but_for_times(self):
        return all(c["ok"] or c["times"] for c in self.criteria)


def gaps_ms(frames):
    return [(b[0] - a[0]) / 1e6 for a, b in zip(frames, frames[1:])]


def stood_still_s(seen, since_ns, until_ns):
    """How long the machine itself stood still in that time or just before it, when the images were on their way."""
    return sum(s for end, s in seen["stalls"] if end >= since_ns - 100_000_000 and end - 1e9 * s <= until_ns)


def missing(seen):
    """Frames missing between others of one opening of the camera, and those of them that went while the machine stood still."""
    server = machine = 0
    for a, b in zip(seen["frames"], seen["frames"][1:]):
        count = max(0, b[2] - a[2] - 1) if a[1] == b[1] else 0
        if count and stood_still_s(seen, a[0], b[0]):
            machine += count
        else:
            server += count
    return server, machine


def longest_gap_ms(seen):
    """Less the time for which the machine stood still."""
    frames = seen["frames"]
    return max(((b[0] - a[0]) / 1e6 - (1e3 * stood_still_s(seen, a[0], b[0]) if b[0] - a[0] > 1e6 * GAP_MS else 0)
                for a, b in zip(frames, frames[1:])), default=1e9)


def quantile(values, share):
    return sorted(values)[min(len(values) - 1, int(share * len(values)))] if values else 0.0


def judge_frames(verdict, seen, drops):
    """`seen` by the good viewer; `drops` that the daemon counted meanwhile, by stage."""
    frames = seen["frames"]
    verdict.check("viewer: connected to the end", seen["problem"] or "yes", not seen["problem"], "yes")
    verdict.check("viewer: frames came", len(frames), len(frames) >= 25 * seen["seconds"], f">= {25 * seen['seconds']:.0f}",
                  times=len(frames) >= 15 * seen["seconds"])
    lost, excused = missing(seen)
    few = BUSY_SHARE * len(frames)
    verdict.check("viewer: frames missing", lost, lost == 0, "0", times=lost <= few)
    again = sum(1 for a, b in zip(frames, frames[1:]) if (b[1], b[2]) <= (a[1], a[2]))
    verdict.check("viewer: frames shown again (no signal)", again, again == 0, "0")
    epochs = len({f[1] for f in frames})
    verdict.check("viewer: times the camera was opened again", epochs - 1, epochs == 1, "0")
    verdict.check("viewer: RTP packets missing", seen["packets_lost"], seen["packets_lost"] == 0, "0",
                  times=seen["packets_lost"] <= few)
    verdict.check("viewer: frames without a message", seen["without_message"], seen["without_message"] == 0, "0")
    gap = longest_gap_ms(seen)
    verdict.check("viewer: longest gap [ms]", round(gap, 1), gap <= GAP_MS, f"<= {GAP_MS:.0f}",
                  times=gap <= LATE * GAP_MS)
    total = None if drops is None else sum(count for stage, count in drops.items() if stage != "observe")
    verdict.check("daemon: frames of this camera it dropped", "metrics not readable" if drops is None else drops,
                  total is not None and total <= excused,
                  "0; not counted: observe, which is shown all the same", times=total is not None and total <= few)


def judge_resources(verdict, rows, before, settled):
    """`rows`: samples during the attacks; `before` the first, `settled` after the last."""
    rss = [r["rss_kb"] / 1024 for r in rows]
    quarter = max(1, len(rss) // 4)
    second, last = statistics.median(rss[quarter:2 * quarter] or rss), statistics.median(rss[-quarter:])
    verdict.check("memory: highest [MB]", round(max(rss)), max(rss) <= RSS_MB, f"<= {RSS_MB}")
    verdict.check("memory: growth after warm-up [MB]", round(last - second, 1), last - second <= RSS_GROWTH_MB,
                  f"<= {RSS_GROWTH_MB} (from {second:.0f})")
    for what in ("descriptors", "threads"):
        verdict.check(f"{what}: left when all attackers are gone", settled[what],
                      settled[what] <= before[what] + SETTLED, f"<= {before[what]} + {SETTLED}")


def bursts(rows):
    """Most lines in any one second, from samples each half second."""
    worst = 0
    for i, row in enumerate(rows):
        worst = max(worst, sum(r["log_lines"] for r in rows[i:] [:4] if r["t"] - row["t"] < 0.9))
    return worst


def judge_signs_of_life(verdict, rows, polls, fed):
    seconds = rows[-1]["t"] - rows[0]["t"]
    average = sum(r["log_lines"] for r in rows) / max(1.0, seconds)
    verdict.check("log: lines a second on average", round(average, 1), average <= LOG_AVERAGE, f"<= {LOG_AVERAGE}")
    verdict.check("log: most lines in one second", bursts(rows), bursts(rows) <= LOG_BURST, f"<= {LOG_BURST}")
    bad = [p for p in polls if p[2]]
    slowest = max((p[1] for p in polls), default=0)
    verdict.check("health: polls not answered 200 within 1 s", f"{len(bad)} of {len(polls)}"
                  + (f", first: {bad[0][2]}" if bad else f", slowest {1e3 * slowest:.0f} ms"),
                  not bad and len(polls) >= 0.4 * seconds, "0",
                  times=len(bad) <= BUSY_SHARE * len(polls) and len(polls) >= 0.1 * seconds)
    gap = max((b - a for a, b in zip(fed, fed[1:])), default=1e9)
    verdict.check("watchdog: longest time without a sign of life [s]", round(gap, 2), gap <= WATCHDOG_S, f"<= {WATCHDOG_S}",
                  times=gap <= LATE / 2 * WATCHDOG_S)


def judge_reloads(verdict, reloads):
    wrong = [r for r in reloads if not r["ok"]]
    verdict.check("reloads: answered, the bad ones refused", f"{len(reloads) - len(wrong)} of {len(reloads)}"
                  + (f", first wrong: {wrong[0]['what']}" if wrong else ""), reloads and not wrong, "all")


def judge_attacks(verdict, report, seconds):
    """An attack that achieved nothing proves nothing."""
    for name, row in report["attacks"].items():
        wanted = {key: max(1, int(least * seconds / 60)) for key, least in row["least"].items()}
        short = {key: row["counts"].get(key, 0) for key, least in wanted.items() if row["counts"].get(key, 0) < least}
        verdict.check(f"attack {name}: took place", short or "yes", not short,
                      ", ".join(f"{k} >= {v}" for k, v in wanted.items()),
                      times=all(count >= max(1, wanted[key] / LATE) for key, count in short.items()))
    crowd = report["attacks"].get("rtsp_sixty_viewers", {"counts": {}})["counts"]
    asked = crowd.get("played", 0) + crowd.get("turned_away", 0)
    if asked:
        verdict.check("new viewers that could watch [%]", round(100 * crowd.get("played", 0) / asked),
                      crowd.get("played", 0) >= NEWCOMERS * asked, f">= {100 * NEWCOMERS:.0f}",
                      times=crowd.get("played", 0) >= NEWCOMERS / 2 * asked)
    verdict.check("attackers: mistakes of their own", report["errors"] or 0, not report["errors"], "0")
    opened = report["attacks"].get("rtsp_http_tunnel_foreign_host", {"counts": {}})["counts"].get("tunnels_opened", 0)
    verdict.check("tunnels opened for a foreign Host", opened, opened == 0, "0")
    shown = report["attacks"].get("http_foreign_host", {"counts": {}})["counts"].get("answer_200", 0)
    verdict.check("HTTP answers 200 for a foreign Host", shown, shown == 0, "0")


def judge_stop(verdict, seconds, status):
    verdict.check("SIGTERM under attack: seconds to the end", round(seconds, 2), seconds <= STOP_S, f"<= {STOP_S}",
                  times=seconds <= LATE * STOP_S)
    verdict.check("SIGTERM under attack: exit status", status, status == 0, "0")
