"""Labels and maps as Parquet: the class tree, the tables, writing, reading, and SQL over them."""
