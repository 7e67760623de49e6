"""The walking ogre on the README's first screen: a picture a pose of the demo's scene.

./dev demo ogre
blender -b build/demo/ogre.blend --python docs/make_ogre_loop.py -- build/demo/loop
convert -delay 4 -loop 0 build/demo/loop/*.png -colors 96 docs/walk.gif
"""

import sys
from pathlib import Path

import bpy

folder = Path(sys.argv[sys.argv.index("--") + 1])
scene = bpy.context.scene
scene.render.engine = "CYCLES"
scene.cycles.samples, scene.cycles.use_denoising = 48, False
scene.render.resolution_x, scene.render.resolution_y = 360, 405
for frame in range(1, 33):
    scene.frame_set(frame)
    scene.render.filepath = str(folder / f"{frame:02}.png")
    bpy.ops.render.render(write_still=True)
