"""The table of skeleton conventions that files are compared with."""

from __future__ import annotations

from geodesic_ocp.recordings.skeletons.skeleton_convention import SkeletonConvention


def _both_sides(**names: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """Names by segment; those of the arms are given with {side}, {Side}, {s} or {S} in them."""
    arms = {"upper_arm": "upper arm", "forearm": "forearm", "hand": "hand"}
    joints = {segment: given for segment, given in names.items() if segment not in arms}
    for side in ("right", "left"):
        letters = {"side": side, "Side": side.title(), "s": side[0], "S": side[0].upper()}
        for key, segment in arms.items():
            joints[f"{side} {segment}"] = tuple(name.format(**letters) for name in names[key])
    return joints


# Between pelvis and thorax many skeletons have two or more joints, of which the abdomen's is one:
# that only decides how their rotation is shared between the lower and the upper joint of the trunk.
_CMU = SkeletonConvention(
    # The bones of the database's .asf files. The radius has the flexion of the elbow, the bone
    # after it ("wrist") the pronation, the hand the flexion and the abduction of the wrist.
    "CMU Graphics Lab (ASF)",
    _both_sides(
        pelvis=("root",),
        abdomen=("upperback", "lowerback"),
        thorax=("thorax",),
        upper_arm=("{s}humerus",),
        forearm=("{s}wrist", "{s}radius"),
        hand=("{s}hand",),
    ),
)
_HUMAN_IK = SkeletonConvention(
    # Names of MotionBuilder's HumanIK, with Mixamo's and 3ds Max's namespaces in front or not; also
    # those of the CMU database's BVH files and of Perception Neuron's. "RightShoulder" is the
    # clavicle here.
    "MotionBuilder, Mixamo, Perception Neuron",
    _both_sides(
        pelvis=("Hips",),
        abdomen=("Spine2", "Spine1", "Spine", "LowerBack"),
        thorax=("Spine3", "Spine2", "Spine1", "Spine", "Chest"),
        upper_arm=("{Side}Arm",),
        forearm=("{Side}ForeArm",),
        hand=("{Side}FingerBase", "{Side}Hand"),
    ),
)
_BIOVISION = SkeletonConvention(
    # Biovision's own names, and those of BVH files from Xsens MVN with Chest to Chest4.
    # "RightShoulder" is the upper arm here, "RightCollar" the clavicle.
    "Biovision, Xsens MVN (BVH)",
    _both_sides(
        pelvis=("Hips", "Hip"),
        abdomen=("Chest2", "Chest", "Abdomen", "Spine"),
        thorax=("Chest4", "Chest3", "Chest2", "Chest", "Torso", "Spine"),
        upper_arm=("{Side}Shoulder", "{Side}UpArm"),
        forearm=("{Side}Elbow", "{Side}LowArm"),
        hand=("{Side}Wrist", "{Side}Hand"),
    ),
)
_MVN = SkeletonConvention(
    # Segments of the Xsens MVN user manual; "RightShoulder" is the clavicle here.
    "Xsens MVN (segments)",
    _both_sides(
        pelvis=("Pelvis",),
        abdomen=("L3", "L5"),
        thorax=("T8",),
        upper_arm=("{Side}UpperArm",),
        forearm=("{Side}ForeArm",),
        hand=("{Side}Hand",),
    ),
)
_BIPED = SkeletonConvention(
    "3ds Max Biped",
    _both_sides(
        pelvis=("Bip01 Pelvis",),
        abdomen=("Bip01 Spine2", "Bip01 Spine1", "Bip01 Spine"),
        thorax=("Bip01 Spine3", "Bip01 Spine2", "Bip01 Spine1", "Bip01 Spine"),
        upper_arm=("Bip01 {S} UpperArm",),
        forearm=("Bip01 {S} Forearm",),
        hand=("Bip01 {S} Hand",),
    ),
)
_POSER = SkeletonConvention(
    "Poser and DAZ",
    _both_sides(
        pelvis=("hip",),
        abdomen=("abdomen",),
        thorax=("chest",),
        upper_arm=("{s}Shldr",),
        forearm=("{s}ForeArm",),
        hand=("{s}Hand",),
    ),
)
#: The body joints of SMPL (Loper et al. 2015, "SMPL: a skinned multi-person linear model", ACM
#: Transactions on Graphics 34(6)): the rest pose is a T pose with y up, facing z.
SMPL = SkeletonConvention(
    "SMPL",
    _both_sides(
        pelvis=("pelvis",),
        abdomen=("spine2", "spine1"),
        thorax=("spine3",),
        upper_arm=("{side}_shoulder",),
        forearm=("{side}_elbow",),
        hand=("{side}_wrist",),
    ),
    up="+y",
    forward="+z",
)
#: Conventions that files are compared with, in this order; see `SkeletonConvention` for others.
SKELETON_CONVENTIONS = (_CMU, _HUMAN_IK, _BIOVISION, _MVN, _BIPED, _POSER, SMPL)
