"""CANopen driver of a servo amplifier and an LVDT, and virtual devices to run it against."""
