"""URDFs of a small arm, and parts to vary it with."""

BASE = '<link name="base"><collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>'
POST = """<link name="post"><collision><origin xyz="0 0 0.2"/>
  <geometry><cylinder radius="0.05" length="0.2"/></geometry></collision></link>"""
FOREARM = """<link name="forearm"><collision><origin xyz="0 0 0.25"/>
  <geometry><box size="0.04 0.04 0.3"/></geometry></collision></link>"""
TURN = """<joint name="turn" type="continuous"><parent link="base"/><child link="post"/><origin xyz="0 0 0.1"/>
  <axis xyz="0 0 2"/><limit velocity="1.5" effort="1"/></joint>"""
BEND = """<joint name="bend" type="revolute"><parent link="post"/><child link="forearm"/><origin xyz="0 0 0.4"/>
  <axis xyz="0 1 0"/><limit lower="-2" upper="2.5" velocity="0.7" effort="1"/></joint>"""
ARM = BASE + POST + FOREARM + TURN + BEND
"""A post of .4 m that turns about z, with a forearm of .4 m on it that bends about y."""

FOLLOWER = """<link name="tip"><collision><geometry><box size="0.02 0.02 0.02"/></geometry></collision></link>
  <joint name="slide" type="prismatic"><parent link="forearm"/><child link="tip"/><origin xyz="0 0 0.5"/>
  <axis xyz="0 0 1"/><limit lower="0" upper="1" velocity="1" effort="1"/>
  <mimic joint="{}" multiplier="2" offset="{}"/></joint>
  <link name="bare"/><joint name="lead" type="revolute"><parent link="base"/><child link="bare"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" velocity="1" effort="1"/></joint>"""
"""A link on the arm whose joint mimics another; for that one's name and the offset."""


def inertial(mass, ixx, iyy, izz, ixy=0.0, xyz="0 0 0"):
    return f"""<inertial><origin xyz="{xyz}"/><mass value="{mass}"/>
      <inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="{ixy}" ixz="0" iyz="0"/></inertial>"""


def collision(shape):
    return f"<collision><geometry>{shape}</geometry></collision>"


def write_urdf(folder, body=ARM, name="arm.urdf"):
    path = folder / name
    path.write_text(f'<robot name="arm" xmlns:drake="http://drake.mit.edu">{body}</robot>')
    return path


def write_srdf(folder, body):
    path = folder / "arm.srdf"
    path.write_text(f'<?xml version="1.0"?><robot name="arm">{body}</robot>')
    return path
