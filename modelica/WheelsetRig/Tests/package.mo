within WheelsetRig;
package Tests "Claims: each model asserts what its name says"
end Tests;
