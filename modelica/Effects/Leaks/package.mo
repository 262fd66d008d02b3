within Effects;
package Leaks "What flows through gaps, pores and holes"
end Leaks;
