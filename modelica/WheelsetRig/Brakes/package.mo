within WheelsetRig;
package Brakes "Disc brakes: from cylinder pressure to friction"
end Brakes;
