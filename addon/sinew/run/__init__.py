"""Deforms bound meshes during Blender's own evaluation. In the order in which a frame calls them:

    in_pass          what Blender calls, and the recipe of a frame: read, decide, build, compute, switch
    characters       all bound meshes of the file; what only the main thread may ask about them
    character        one bound mesh: its planning, its status, and what its graph copies share
    graph_copies     all that is known of each evaluated object, which goes with its graph, in three parts:
      fast_path        what is watched of it, and deforms it while that is unchanged
      reading          what was read of its mesh and its shape keys
      ../chain         what was built from that, and computes the shape
    planning         when a plan is made, and when the main thread is asked for mends
    afterwards       restores switches and shape keys after an evaluation, for whoever reads evaluated copies
    switching        which modifiers Blender evaluates in this pass, its own or Sinew's; leaves all to it for a while
    errors           what goes wrong with a mesh, for the panel and the log
    mail             what an evaluation asks the main thread for

And for others: status (what the panel is told).
"""
