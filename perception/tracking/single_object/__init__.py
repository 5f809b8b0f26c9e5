"""One object followed from its first box on, by LiDAR and camera together or by one of them."""
