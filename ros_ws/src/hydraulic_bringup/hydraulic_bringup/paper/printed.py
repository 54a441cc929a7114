"""What the paper prints, and what it leaves out.

Z. Nisar, H. Munawar, "System Identification and Controller Design for Hydraulic Actuator": tables "Available
literature" and "Model selection criteria", and what its text draws from a figure of RMSE without values.
"""

BEST_FIT = {"multisine": 99.17, "chirp": 98.79}
MSE = {"multisine": 0.002918, "chirp": 0.00301}
FPE = {"multisine": 0.00304, "chirp": 0.00311}
RMSE_ORDER = {"chirp": ("triangle", "square", "sawtooth"), "multisine": ("triangle", "sine", "square")}
"""Shapes with the least RMSE, the least first, as its text says."""
BETTER = "chirp"
"""The excitation whose model shows the smaller RMSE, as its text says."""

REVIEWED = (
    ("Rahmat 2010", "multisine", "arx", 4, 92.8),
    ("Izzuddin 2015", "multisine", "arx", 3, 95.86),
    ("Izzuddin 2015", "step", "arx", 3, 94.67),
    ("Ishak 2006", "multisine", "arx", 3, 91.16),
    ("Wang 2009", "sine", "arx", 3, None),
    ("Ren 2018", "chirp", "transfer_function", 4, None),
)
"""Works it compares itself with: authors, excitation, kind and order of the model, best fit [%] where there is one."""

LEFT_OUT = (
    "The value of the bandwidth and its definition are not printed. Here: the closed position loop at half the "
    "critical gain of the linearised model (see `bandwidth`).",
    "The amplitudes are not printed, only that the actuator shall not saturate. Here: the largest at which a rehearsal "
    "on the model keeps drive, travel, speed and pressures within their limits.",
    "The sampling time of the multisine's transfer function is not printed. Here: 10 ms. The ARX model is sampled "
    "every 50 ms, as printed.",
    "The unit of MSE and FPE is not printed. Here: mm², one step ahead for the ARX model, free run for the transfer "
    "function, on the estimation data, so that they can only be set beside each other.",
    "Amplitudes and frequencies of the validation signals, and the values of their RMSE, are not printed. Here: the "
    "grid that is shown.",
    "The printed parameters describe no usable actuator (K_a = 491.04e-12 moves it by picometres; 10 V open 22 µm of "
    "17.8 mm; no supply pressure or density). Here: the preset moog_mcr_m_1002_bench, which names its sources and "
    "keeps the printed values beside its own.",
    "The transfer function prints ω_a where ω_a² belongs; models here are fitted without it.",
    "Reference amplitudes and gains of the controller are not printed.",
)
