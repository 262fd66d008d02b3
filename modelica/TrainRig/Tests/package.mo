within TrainRig;
package Tests "Claims: each model asserts what must hold, and runs to its StopTime"
end Tests;
