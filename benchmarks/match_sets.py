"""Pairs of shapes with ground truth: public sets in a folder, and bodies of our own.

FOLDER holds copies of public repositories under their own names:

    SGA18_orientation_BCICP_dataset       remeshed FAUST and TOSCA (Ren et al. 2018)
    DUO-FM                                SMAL, uneven FAUST and SCAPE (Donati et al. 2022)
    SHREC19_matching_humans               people of eleven sources (Melzi et al. 2019)
    becos-code                            animals and people of TOSCA (Ehm et al. 2025)
    Hyperspectral-Inverse-Skinning        animations and poses that share their vertices
    Intrinsic-Symmetry-Curve-Generation-  SHREC'07, with points marked by hand (Kim et al. 2011)
    SSC-MorphVQ                           mandibles of mice, with landmarks (Thomas 2024)
    Mouse_Models                          skulls of mice, with landmarks (Zhang et al. 2022)
    eos                                   the Surrey Face Model (Huber et al. 2016)
    tosca_remeshed                        23 of those TOSCA shapes and their pairs (CONTRIBUTING.md)

A set is a function of the folder, a seed and a number of pairs; it lists what draws its cases.
"""

from becos import species
from cloud_sets import clouds
from extra_sets import extras
from face_sets import faces
from match_cases import Set
from own_sets import HARM, bodies, different
from part_sets import HELD_OUT, KNOWN, parts, small_parts
from public_sets import SHREC07, all_pairs, listed, sequences, shrec07, shrec19, specimens

MANDIBLES = "SSC-MorphVQ/data/MMD_12K_TEST/raw/mandible_ply/*_Model.ply"
MANDIBLE_LANDMARKS = (
    "SSC-MorphVQ/post_processing/TEST_DATASET_GROUND_TRUTH_LANDMARKS/*_Landmarks_GT.fcsv"
)
SGA18 = "SGA18_orientation_BCICP_dataset/Dataset/{}/vtx_5k"
SETS: dict[str, Set] = {
    "faust": listed(SGA18.format("FAUST"), "../test_pairs.txt"),
    "tosca": listed(SGA18.format("TOSCA_Isometric"), "../test_pairs.txt"),
    "tosca-both": listed("tosca_remeshed", "pairs.txt", both=True),
    "apes": listed(SGA18.format("TOSCA_nonIsometric"), "../test_pairs.txt"),
    "smal": all_pairs("DUO-FM/data/SMAL_r/shapes_test"),
    "smal-train": all_pairs("DUO-FM/data/SMAL_r/shapes_train"),
    "uneven-faust": all_pairs("DUO-FM/data/FAUST_a/shapes_test"),
    "uneven-scape": all_pairs("DUO-FM/data/SCAPE_a/shapes_test"),
    "shrec19": shrec19,
    "shrec07": shrec07(*SHREC07),
    "shrec07-halves": shrec07("human", "teddy", "armadillo", "fourleg", half=True),
    "sequences": sequences,
    "mandibles": specimens(MANDIBLES, MANDIBLE_LANDMARKS),
    "skulls": specimens("Mouse_Models/Models/*.ply", "Mouse_Models/LMs/*.mrk.json"),
    "species": species(True),
    "species-parts": species(False),
    "parts": parts(KNOWN, two_kinds=False),
    "parts-kinds": parts(KNOWN, two_kinds=True),
    "parts-held-out": parts(HELD_OUT, two_kinds=False),
    "parts-kinds-held-out": parts(HELD_OUT, two_kinds=True),
    "parts-small": small_parts(KNOWN),
    "parts-small-held-out": small_parts(HELD_OUT),
    "faces": faces(in_parts=False),
    "faces-parts": faces(in_parts=True),
    "poses": bodies("own", "poses"),
    **{f"poses-{n}": bodies("own", "poses", n) for n in (1000, 5000, 20000)},
    "proportions": bodies("own", "proportions"),
    "octopuses": bodies("octopuses", "proportions"),
    "different": different,
    "extras": extras,
    "clouds": clouds(0.0),
    "clouds-noise": clouds(0.005),
    "clouds-views": clouds(0.0, view=True),
    "clouds-2000": clouds(0.0, 2000),
    "clouds-100000": clouds(0.005, 100_000),
} | {
    f"{shapes}{done}": bodies(of, done)
    for shapes, of in (("", "own"), ("octopus-", "octopuses"), ("tosca-", "tosca"))
    for done in HARM
    if (of, done) != ("tosca", "noise")
}
