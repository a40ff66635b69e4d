// Which item of a list an invocation of a compute shader does; not all are below its count.
#define ITEM (gl_WorkGroupID.y * gl_NumWorkGroups.x * gl_WorkGroupSize.x + gl_GlobalInvocationID.x)
