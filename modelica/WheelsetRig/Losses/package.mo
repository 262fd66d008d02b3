within WheelsetRig;
package Losses "Bearing friction and windage"
end Losses;
