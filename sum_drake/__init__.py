"""Sequential Scene Understanding and Manipulation (Sui, Zhou, Zeng and Jenkins, 2017) as Drake systems."""

__version__ = "0.1.0"
