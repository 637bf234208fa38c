# SPDX-License-Identifier: Apache-2.0
"""GigE Vision over a network that loses, reorders and delays packets (netem between two namespaces): incomplete
frames are dropped and counted, packets are asked for again, and no frame is ever delivered torn."""
import os
import re
import subprocess
import time

from guest import ENVIRONMENT, PREFIX, check, finish, mount_product, program, say, until

CAMERA, HOST = "10.9.0.2", "10.9.0.1"
SECONDS = 12
FAULTS = {
    "0.1 % loss": "loss 0.1%",
    "0.5 % loss": "loss 0.5%",
    "reordering": "delay 2ms reorder 75% 50%",
    "delay": "delay 10ms 3ms distribution normal",
}


def sh(command):
    subprocess.run(command.split(), check=True)


def netem(fault):
    subprocess.run("ip netns exec far tc qdisc del dev veth1 root".split(), stderr=subprocess.DEVNULL, check=False)
    if fault:
        sh("ip netns exec far tc qdisc add dev veth1 root netem limit 10000 " + fault)


def network():
    for command in ("modprobe veth", "modprobe sch_netem", "ip netns add far", "ip link add veth0 type veth peer name veth1",
                    "ip link set veth1 netns far", f"ip addr add {HOST}/24 dev veth0", "ip link set veth0 up",
                    f"ip -n far addr add {CAMERA}/24 dev veth1", "ip -n far link set veth1 up",
                    "ip -n far link set lo up", "sysctl -q -w net.core.rmem_max=33554432"):
        sh(command)


def start(*command):
    process = subprocess.Popen(["ip", "netns", "exec", "far", *command], env=dict(os.environ, **ENVIRONMENT),
                               stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    until(lambda: CAMERA in subprocess.run(["ip", "netns", "exec", "far", "ss", "-ulnH"], capture_output=True, text=True,
                                           check=True).stdout, "the camera listens")
    return process


def stream(kind):
    done = program("capture_probe", "pattern", kind, CAMERA, "320x180", str(SECONDS))
    numbers = dict.fromkeys(("good", "torn", "incomplete", "resent", "missing"), 0)
    numbers |= {key: int(value) for key, value in re.findall(r"(\w+)=(\d+)", done.stdout)}
    say("      " + " ".join(done.stdout.split()))
    return numbers


def run(kind, resends, *command):
    say(f"== {command[0]}")
    camera = start(f"{PREFIX}/bin/{command[0]}", *command[1:])
    netem("")
    clean = stream(kind)
    check("without faults all frames come", clean["good"] >= 60 and clean["torn"] == 0 and clean["missing"] == 0)
    for name, fault in FAULTS.items():
        time.sleep(1)
        netem(fault)
        got = stream(kind)
        check(f"{name}: no frame is torn", got["torn"] == 0 and got["good"] >= 30)
        if name == "0.5 % loss" and not resends:
            check(f"{name}: incomplete frames are dropped and counted", got["incomplete"] >= 3)
        elif name == "0.5 % loss":
            check(f"{name}: packets come again, frames are complete",
                  got["resent"] >= 3 and got["incomplete"] <= got["resent"] // 3)
        elif "loss" not in name:
            check(f"{name}: nothing is lost by it", got["incomplete"] <= 2)
    netem("")
    camera.terminate()
    camera.wait(timeout=30)


def main():
    mount_product()
    network()
    run("gv", False, "arv-fake-gv-camera-0.8", "-i", CAMERA, "-s", "GV01")
    run("sim", True, "gige_simulator", "--address", CAMERA, "--serial", "SIM1", "--rate", "15",
        "--mtu", "1500")
    finish()


main()
