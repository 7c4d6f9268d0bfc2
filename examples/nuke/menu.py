"""What Nuke runs as it begins, with the folder on its plug-in path: the node stands in the menu."""

import nuke

nuke.menu("Nodes").addCommand("Image/shrm", "nuke.createNode('shrm')")
