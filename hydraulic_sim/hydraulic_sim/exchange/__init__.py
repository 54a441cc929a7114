"""Models that travel: a composed plant as C without Python and as a Functional Mock-up Unit, and FMUs of others.

`translator` turns the small part of Python in which effects and the plant's loop are written into C99; `plant_source`
applies it to the very text that numba compiles; `fmu` adds the interface (FMI 2.0, co-simulation), compiles and packs;
`foreign` runs an FMU, whoever made it, beside a record.
"""
