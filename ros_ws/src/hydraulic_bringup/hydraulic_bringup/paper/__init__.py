"""The study of Nisar & Munawar as one run: excitation from the bandwidth, models, validation, beside its figures.

`printed` holds what the paper says; `study` which excitations are played and how they are identified; `playing` plays
them through the node graph or on the model; `document` puts all into one result; `control` adds the controller.
"""
