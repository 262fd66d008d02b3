within ServoPendulum;
package Signals "What is wrong between goal, shaft, weight and reading"
end Signals;
