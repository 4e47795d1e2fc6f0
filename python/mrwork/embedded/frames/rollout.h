/* The model of the law at an instant: motion of the coordinates, currents and states of the dampers, loops of storeys. */
typedef struct {
    $real displacement[$n_coordinates], velocity[$n_coordinates], devices[$n_states], loops[$max_loops];
} ${name}_moment;

/* What the rollout keeps from sample to sample. */
typedef struct {
    ${name}_moment now;
    $real followed[$n_coordinates], strengths[2 * $max_loops], offset[$n_coordinates];
    $real deformation[$n_all], rate[$n_all], deformation_before[$n_all], rate_before[$n_all];
    $real measured[$n_all], expected[$n_all], scale[$n_all], held[$n_all];
    $real sent[$delay + 2][$n_all];
    $real doubt, ground, strongest, peaks[2];
    $real readings[$max_order], weights[$max_order], covariance[$max_order][$max_order], nodes[$n_nodes];
    $real shaking[2 * $horizon_steps + 3];  /* forecast at start, middle and end of each step */
    int number;
} ${name}_plan;

