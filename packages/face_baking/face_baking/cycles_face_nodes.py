"""Node trees of materials, built in few words. Runs in Blender's own Python: see cycles_face_worker.py."""

from typing import Any

import bpy


class Nodes:
    """Builds a material's node tree; values may be numbers or the outputs of other nodes."""

    def __init__(self, name: str) -> None:
        self.material = bpy.data.materials.new(name)
        self.material.use_nodes = True
        self.tree = self.material.node_tree
        self.tree.nodes.clear()
        self.out = self.add("OutputMaterial")

    def add(self, kind: str, **settings: Any) -> Any:
        """Add a node; a setting is a property of it or, with _ for spaces, one of its inputs."""
        node = self.tree.nodes.new(f"ShaderNode{kind}")
        for key, value in settings.items():
            if hasattr(node, key):
                setattr(node, key, value)
            else:
                self.put(value, node.inputs[key.replace("_", " ")])
        return node

    def put(self, value: Any, socket: Any) -> None:
        """Link an output or set a number."""
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value

    def math(self, operation: str, *values: Any) -> Any:
        """Result of a Math node."""
        node = self.add("Math", operation=operation)
        for k, value in enumerate(values):
            self.put(value, node.inputs[k])
        return node.outputs[0]

    def vector(self, operation: str, *values: Any, scale: Any = None) -> Any:
        """Result of a VectorMath node; a number where the operation gives one."""
        node = self.add("VectorMath", operation=operation)
        for k, value in enumerate(values):
            self.put(value, node.inputs[k])
        if scale is not None:
            self.put(scale, node.inputs["Scale"])
        return node.outputs["Value" if operation == "DOT_PRODUCT" else "Vector"]

    def attribute(self, name: str, vector: bool = False) -> Any:
        """A per-vertex value."""
        return self.add("Attribute", attribute_name=name).outputs["Vector" if vector else "Fac"]

    def noise(
        self, at: Any, scale: float, detail: float = 3.0, rough: float = 0.55, distortion: float = 0.0
    ) -> Any:
        """Noise in 0-1."""
        return self.add(
            "TexNoise", Vector=at, Scale=scale, Detail=detail, Roughness=rough, Distortion=distortion
        ).outputs[0]

    def ramp(self, x: Any, a: float, b: float, c: float = 0.0, d: float = 1.0, soft: bool = True) -> Any:
        """Map a-b to c-d."""
        node = self.add("MapRange", interpolation_type="SMOOTHSTEP" if soft else "LINEAR")
        for k, value in enumerate((x, a, b, c, d)):
            self.put(value, node.inputs[k])
        return node.outputs[0]

    def surface(self, node: Any) -> Any:
        """Use a shader as the material's surface."""
        self.tree.links.new(node.outputs[0], self.out.inputs["Surface"])
        return self.material
