"""The command of a ROS 2 launch file, as JSON, without ROS: stand-ins for the few names of `launch` that it uses.

    launch_file.py FILE [NAME:=VALUE …]
"""

import json
import runpy
import sys
import types

values, declared, commands = {}, [], []


class LaunchDescription:
    def __init__(self, actions):
        for action in actions:
            assert isinstance(action, (DeclareLaunchArgument, ExecuteProcess)), action


class DeclareLaunchArgument:
    def __init__(self, name, *, default_value, description):
        assert isinstance(default_value, str) and description
        values.setdefault(name, default_value)
        declared.append(name)


class ExecuteProcess:
    def __init__(self, *, cmd, output, respawn, respawn_delay):
        assert output == "screen" and respawn is True and respawn_delay > 0
        commands.append(cmd)


class LaunchConfiguration:
    def __init__(self, name):
        self.name = name


def text(word):
    if isinstance(word, list):
        return "".join(map(text, word))
    return values[word.name] if isinstance(word, LaunchConfiguration) else word


for name, items in {"launch": [LaunchDescription], "launch.actions": [DeclareLaunchArgument, ExecuteProcess],
                    "launch.substitutions": [LaunchConfiguration]}.items():
    module = types.ModuleType(name)
    module.__dict__.update({item.__name__: item for item in items})
    sys.modules[name] = module

file, *arguments = sys.argv[1:]
values.update(argument.split(":=", 1) for argument in arguments)
assert isinstance(runpy.run_path(file)["generate_launch_description"](), LaunchDescription)
assert set(values) == set(declared), "an argument that is not declared"
[command] = commands
print(json.dumps([text(word) for word in command]))
