within WheelsetRig;
package Quantities "What is taken for constant: from the nominal value to the actual one"
end Quantities;
