within AirSupply;
package Slots "Partial models by which slots are constrained, and their null versions"
end Slots;
