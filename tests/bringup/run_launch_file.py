"""Runs the launch file of the bench as `ros2 launch` does, with the arguments name:=value."""

from __future__ import annotations

import sys
from pathlib import Path

from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

from launch import LaunchDescription, LaunchService

FILE = Path(__file__).resolve().parents[2] / "ros_ws/src/hydraulic_bringup/launch/bench.launch.py"

given = [setting.split(":=", 1) for setting in sys.argv[1:]]
bench = IncludeLaunchDescription(PythonLaunchDescriptionSource(str(FILE)), launch_arguments=given)
service = LaunchService(noninteractive=True)
service.include_launch_description(LaunchDescription([bench]))
sys.exit(service.run())
