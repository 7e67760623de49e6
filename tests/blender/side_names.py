"""How rigs name the two sides: (a bone of the left, that of the right, whether Blender's flip_name knows it)."""

SIDE_NAMES = (
    ("arm.L", "arm.R", True),
    ("arm_l", "arm_r", True),
    ("arm-L", "arm-R", True),
    ("L_arm", "R_arm", True),
    ("Left arm", "Right arm", True),
    ("LeftArm", "RightArm", True),
    ("armLeft", "armRight", True),
    ("arm_left", "arm_right", True),
    ("arm.L.001", "arm.R.001", True),
    ("Armature|arm_L", "Armature|arm_R", True),
    ("mixamorig:LeftArm", "mixamorig:RightArm", False),
    ("ArmLeft01", "ArmRight01", False),
    ("ArmL", "ArmR", False),
    ("arm_L_jnt", "arm_R_jnt", False),
    ("lShldrBend", "rShldrBend", False),
    ("Bip01 L Arm", "Bip01 R Arm", False),
    ("CC_Base_L_Upperarm", "CC_Base_R_Upperarm", False),
    ("arm_sx", "arm_dx", False),
    ("b_arm_1", "b_arm_2", False),
    ("左腕", "右腕", False),
)
