// A program that does nothing, whose precompiled headers others use.
int main() { return 0; }
