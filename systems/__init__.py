"""The upper storey: thin LeafSystems over the functions of `sum_drake`, and the diagrams made of them."""
