"""Virtual devices: a CiA 408 servo valve, a CiA 406 LVDT and CiA 404 pressure transducers over a plant handed in.

They speak CANopen on whatever bus they are given (`virtual`, `udp_multicast`, SocketCAN), as the devices of a bus
file would, and can be made to fail (`faults`). Nothing here knows how the driver codes a quantity: each device counts
in the steps of its own object dictionary, so that the two sides check each other.
"""

from hydraulic_can_driver.virtual.bench import VirtualBench
from hydraulic_can_driver.virtual.plant import Plant, Reading

__all__ = ["Plant", "Reading", "VirtualBench"]
