"""What computes a mesh's shape, read from evaluated data-blocks and built once:

chain            shape keys, the first mix and the stages in a native Deformer, and what each frame hands to it
mixes            the Armature modifiers that Multi Modifier mixes: the first mix, and later ones
layers           one Armature modifier: its skin, its method, its pose
bone_editions    whether an armature still has the bones from which a layer was made
methods          the skinning methods that Blender does not have
shape_keys       relative shape keys: read, silenced, given back
stages           the modifiers after skinning; cage_stages those that follow another object's shape
driven_settings  settings of modifiers that drivers set
leaving          LeaveToBlender, the exception by which any of these, or of the room run, leaves the mesh to Blender
living           counts living owners and native objects, for tests
"""
