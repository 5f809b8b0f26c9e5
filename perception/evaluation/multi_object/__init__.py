"""How well many objects are tracked: HOTA, CLEAR and identity, arrays in, named results out."""
