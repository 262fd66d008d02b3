within WheelsetRig;
package Joints "Joints with small motion; each carries its motion as states"
end Joints;
