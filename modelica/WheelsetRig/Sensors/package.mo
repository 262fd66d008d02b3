within WheelsetRig;
package Sensors "Sensors: from the true value to the reading"
end Sensors;
