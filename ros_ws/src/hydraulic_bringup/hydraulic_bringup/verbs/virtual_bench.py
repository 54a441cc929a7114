"""``virtual_bench``: the CAN devices of a bus file, simulated: servo valve, LVDT and transducers over a model's plant.

The driver node cannot tell them from a bench: start them on the interface that it uses. Amplifier settings (``--set``)
act on the spool, and faults (``--fault``) happen at a time of the devices. Ends with Ctrl-C.
"""

from __future__ import annotations

import argparse
import gc
import re
import signal
import sys
import threading
from dataclasses import replace
from functools import partial

from hydraulic_bringup.model_plant import ModelPlant
from hydraulic_can_driver.bus import Bus
from hydraulic_can_driver.bus_file import load_bus
from hydraulic_can_driver.virtual import VirtualBench
from hydraulic_can_driver.virtual.faults import FAULTS, InjectedFault
from hydraulic_can_driver.virtual.wiring import Event
from hydraulic_node_utils import cli
from hydraulic_node_utils.scheduling import request_realtime
from hydraulic_sim.model_file import load_model
from hydraulic_sim.trust import add_trust_option

READY = "ready:"
Timed = tuple[InjectedFault, float, float]
_SHOWN = ("power", "nmt", "state", "emcy")
_PRIORITY = 30  # above the driver's: devices do not wait for each other's programs
_SWITCH_INTERVAL_S = 5e-5
_SETTING = re.compile(r"(?:(?P<node>\w+):)?(?P<index>0x[0-9A-Fa-f]{4})(?::(?P<sub>\d+))?=(?P<value>-?\w+)")
_FAULT = re.compile(r"(?P<name>\w+):(?P<node>\w+)@(?P<begin>[\d.]+)(?:-(?P<end>[\d.]+))?")


def main(argv: list[str] | None = None) -> int:
    """Run the devices until Ctrl-C or SIGTERM; 0 then, 1 if the plant fails, 2 for bad options or input."""
    return cli.run(_parser(), _serve, argv)


def _serve(options: argparse.Namespace) -> int:
    leave = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: leave.set())
    bus = load_bus(options.bus)
    bus = replace(
        bus,
        interface=options.interface or bus.interface,
        channel=options.channel or bus.channel,
        rate=options.rate or bus.rate,
    )
    faults = [_fault(text, bus) for text in options.fault]
    plant = ModelPlant(
        load_model(options.model),
        bus.rate,
        options.initial_position,
        options.position_noise,
        options.pressure_noise,
        options.noise_seed,
    )
    bench = VirtualBench(bus, None, plant, options.lockstep)
    for text in options.set:
        _store(bench, text)
    if options.listen:
        threading.Thread(target=_listen, args=(bench,), daemon=True).start()
    return _run(bench, faults, options.model, leave)


def _listen(bench: VirtualBench) -> None:
    """Begin (``+NAME:NODE``) and end (``-NAME:NODE``) faults as lines on standard input say."""
    on: dict[str, InjectedFault] = {}
    for line in sys.stdin:
        sign, text = line[:1], line[1:].strip()
        try:
            if sign == "+" and text not in on:
                on[text] = _fault(f"{text}@0", bench.bus)[0]
                bench.inject(on[text])
            elif sign == "-" and text in on:
                bench.clear(on.pop(text))
        except cli.UsageError as error:
            print(f"virtual_bench: {error}", file=sys.stderr)


def _run(bench: VirtualBench, faults: list[Timed], model: str, leave: threading.Event) -> int:
    bus = bench.bus
    bench.listeners.append(_show)
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    if not bench.lockstep:
        request_realtime(_PRIORITY)  # the bench's threads inherit it
    gc.collect()
    gc.freeze()
    try:
        bench.start()
        devices = ", ".join(f"{name} 0x{node.id:02X}" for name, node in bus.nodes.items())
        print(f"{READY} {devices} of {bus.name} on {bus.interface} {bus.channel}, {bus.rate:g} Hz, {model}", flush=True)
        for fault, begin, end in faults:
            bench.after(begin, partial(bench.inject, fault))
            if end > begin:
                bench.after(end, partial(bench.clear, fault))
        while not leave.wait(0.2):
            if bench.error is not None:
                print(f"virtual_bench: the plant failed: {bench.error}", file=sys.stderr)
                return 1
    finally:
        bench.stop()
    return 0


def _show(event: Event) -> None:
    if event.kind in _SHOWN:
        print(f"{event.node}: {event.kind} {event.detail}", flush=True)


def _store(bench: VirtualBench, text: str) -> None:
    """Apply ``[NODE:]0xINDEX[:SUB]=VALUE``."""
    found = _SETTING.fullmatch(text)
    if found is None:
        raise cli.UsageError(f"--set {text}: expected [NODE:]0xINDEX[:SUB]=VALUE, such as 0x6324:1=200")
    name = found["node"] or bench.valve.name
    if name not in bench.devices:
        raise cli.UsageError(f"--set {text}: there is no node {name}; there are {', '.join(bench.devices)}")
    bench.devices[name].store(int(found["index"], 16), int(found["sub"] or 0), int(found["value"], 0))


def _fault(text: str, bus: Bus) -> Timed:
    """Fault, begin and end [s] of ``NAME:NODE@BEGIN[-END]``."""
    found = _FAULT.fullmatch(text)
    if found is None or found["name"] not in FAULTS:
        raise cli.UsageError(f"--fault {text}: expected NAME:NODE@BEGIN[-END] in s; names: {', '.join(FAULTS)}")
    if found["node"] not in bus.nodes:
        raise cli.UsageError(f"--fault {text}: there is no node {found['node']}; there are {', '.join(bus.nodes)}")
    fault = FAULTS[found["name"]](found["node"])
    kinds = fault.profiles
    if kinds and bus.nodes[found["node"]].profile not in kinds:
        only = ", ".join(map(str, kinds))
        raise cli.UsageError(f"--fault {text}: {found['node']} cannot have it; only profile {only}")
    return fault, float(found["begin"]), float(found["end"] or 0.0)


def _parser() -> argparse.ArgumentParser:
    parser = cli.parser("virtual_bench", __doc__.partition("\n\n")[2])
    add = parser.add_argument
    add("--bus", default="bench", help="bus file, or the name of a shipped one (default: %(default)s)")
    add("--interface", default="", help="python-can interface: socketcan, udp_multicast (default: the bus file's)")
    add("--channel", default="", help="channel of the interface: can0, vcan0, 239.74.163.2:43113")
    add("--rate", type=float, default=0.0, metavar="HZ", help="SYNCs per second, as the driver is set to")
    add("--model", default="moog_mcr_m_1002_bench", help="model file, or a preset's name (default: %(default)s)")
    add_trust_option(parser)
    add("--initial-position", type=float, default=0.0, metavar="M", help="of the piston, 0 is mid-stroke")
    add("--position-noise", type=float, default=0.0, metavar="M", help="standard deviation")
    add("--pressure-noise", type=float, default=0.0, metavar="PA", help="standard deviation, of each transducer")
    add("--noise-seed", type=int, default=0, metavar="N", help="of all noise")
    add("--lockstep", action="store_true", help="time passes by SYNCs alone; for a driver that is in lockstep too")
    add("--set", action="append", default=[], metavar="[NODE:]INDEX[:SUB]=VALUE", help="setting stored in a device")
    add("--fault", action="append", default=[], metavar="NAME:NODE@BEGIN[-END]", help=f"of {', '.join(FAULTS)}")
    add("--listen", action="store_true", help="begin and end faults by lines +NAME:NODE, -NAME:NODE on standard input")
    return parser


if __name__ == "__main__":
    sys.exit(main())
