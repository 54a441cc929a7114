"""The main job in one go: excite, record, identify, compare, report.

`online` runs the graph (simulator, recorder, excitation) as processes on a private domain and leaves bags;
`offline` turns records and a model into figures and a page; `processes` starts and surely ends the children.
"""
