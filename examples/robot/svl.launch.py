"""svl in a ROS 2 launch file: results of the cameras' topics. svl itself needs no ROS.

    ros2 launch svl.launch.py left:=/left/image_raw right:=/right/image_raw camera_height:=0.25
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.substitutions import LaunchConfiguration

ARGUMENTS = {
    "left": ("/left/image_raw", "topic of the left images"),
    "right": ("/right/image_raw", "topic of the right images"),
    "algorithm": ("v5", "as `svl algos` lists them"),
    "prefix": ("/svl", "prefix of the topics of the results"),
    "camera_height": ("0.25", "height of the camera above the floor, metres"),
}


def generate_launch_description():
    value = LaunchConfiguration
    svl = ExecuteProcess(
        # ROS_DOMAIN_ID and ROS_LOCALHOST_ONLY hold for svl as for ROS.
        cmd=[
            "svl", "replay", ["ros2:", value("left"), ",", value("right")], "--algo", value("algorithm"),
            "--publish", ["ros2:", value("prefix")], "--camera-height", value("camera_height"),
        ],
        output="screen",
        # It ends if it hears no pair for ten seconds at its start.
        respawn=True,
        respawn_delay=2.0,
    )
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, (default, description) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, svl])
