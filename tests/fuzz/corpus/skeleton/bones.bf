-1 -1 0 0 0 root
0 0 0 1 0 upper arm
1 1 0 1 0 lower arm
