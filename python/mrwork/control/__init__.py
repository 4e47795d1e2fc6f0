"""Control: from a building, its devices and weights to the finished numbers that control laws run on."""
