"""Tables: CSV, Parquet, JSON, Motive, LeRobot, and folders of them, whose columns become fields."""
