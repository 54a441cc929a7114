"""What `./bench` does before and around the ROS 2 packages: environment, workspace, verbs.

Runs on a bare Python 3.10 to 3.13, before anything is installed: standard library only. One verb is one file
in `verbs/`; what `./bench doctor` looks at is in `probes/`.
"""
